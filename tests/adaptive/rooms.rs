//! Rooms by chance, as scene files: walls, lamps, balls and boxes of all materials.

use std::f32::consts::PI;
use std::fmt::Write;

use base::{Rng, Stream};
use glam::Vec3;

/// The scene file of a room; the same number gives the same room.
pub(crate) fn room(number: u64) -> String {
    let mut dice = Dice(Rng::new(number, Stream::Test, 0));
    let half = Vec3::new(dice.between(1.5, 3.0), dice.between(1.0, 1.75), dice.between(2.0, 3.5));
    let is_open = dice.happens(0.4);
    // From inside, or through the open front.
    let z = if is_open { half.z + 2.2 * half.x } else { half.z - 0.1 };
    let eye = Vec3::new(half.x * dice.between(-0.5, 0.5), half.y * dice.between(0.7, 1.5), z);
    let target = Vec3::new(half.x * dice.between(-0.2, 0.2), half.y * 0.8, -0.3 * half.z);
    let fov = if is_open { 50.0 } else { dice.between(55.0, 75.0) };
    let mut scene = format!(
        "camera = {{ origin = {}, target = {}, fov = {fov:.1} }}\n",
        list(eye),
        list(target)
    );
    let mut add = |lines: String| scene += &lines;
    add(walls(half, is_open, &mut dice));

    let area = 8.0 * (half.x * half.y + half.y * half.z + half.z * half.x);
    let n_lights = 1 + dice.below(4);
    for i in 0..n_lights {
        let flux = area * dice.between(0.3, 1.2) / n_lights as f32;
        add(light(&format!("light{i}"), half, flux, &mut dice));
    }

    // Balls around what was placed: nothing cuts through anything else.
    let mut placed: Vec<(Vec3, f32)> = Vec::new();
    let nearest = if is_open { 0.8 } else { 0.3 } * half.z;
    for i in 0..5 + dice.below(10) {
        let radius = dice.between(0.15, 0.55);
        let lowest =
            if dice.happens(0.7) { radius + 0.01 } else { dice.between(radius + 0.01, half.y) };
        let center = Vec3::new(
            dice.between(-1.0, 1.0) * (half.x - radius),
            lowest,
            dice.between(radius - half.z, nearest),
        );
        if placed.iter().all(|(c, r)| c.distance(center) > r + radius + 0.02) {
            placed.push((center, radius));
            add(thing(&format!("thing{i}"), center, radius, &mut dice));
        }
    }
    scene
}

/// The numbers that a room is made of.
struct Dice(Rng);

impl Dice {
    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.0.next_f32()
    }

    fn below(&mut self, n: usize) -> usize {
        (self.0.next_f32() * n as f32) as usize
    }

    fn happens(&mut self, probability: f32) -> bool {
        self.0.next_f32() < probability
    }

    fn color(&mut self, low: f32, high: f32) -> Vec3 {
        Vec3::new(self.between(low, high), self.between(low, high), self.between(low, high))
    }
}

fn list(v: Vec3) -> String {
    format!("[{:.4}, {:.4}, {:.4}]", v.x, v.y, v.z)
}

fn walls(half: Vec3, is_open: bool, dice: &mut Dice) -> String {
    let (low, high) = (Vec3::new(-half.x, 0.0, -half.z), Vec3::new(half.x, 2.0 * half.y, half.z));
    let [x, y, z] = [Vec3::X * half.x, Vec3::Y * half.y, Vec3::Z * half.z].map(|v| 2.0 * v);
    let sides = [
        ("floor", low, z, x),
        ("ceiling", high, -x, -z),
        ("back", low, x, y),
        ("left", low, y, z),
        ("right", high, -z, -y),
        ("front", high, -y, -x),
    ];
    let mut lines = String::new();
    for (name, corner, a, b) in sides.into_iter().take(if is_open { 5 } else { 6 }) {
        // Most are whitish, some have a color.
        let albedo = if dice.happens(0.7) {
            Vec3::splat(dice.between(0.5, 0.8))
        } else {
            dice.color(0.05, 0.75)
        };
        lines += &format!("[materials.{name}]\ntype = \"diffuse\"\nalbedo = {}\n", list(albedo));
        lines += &quad(name, corner, a, b);
    }
    lines
}

fn quad(material: &str, corner: Vec3, a: Vec3, b: Vec3) -> String {
    let (corner, a, b) = (list(corner), list(a), list(b));
    format!("[[quads]]\ncorner = {corner}\nedges = [{a}, {b}]\nmaterial = \"{material}\"\n")
}

/// A lamp below the ceiling, a panel on the left wall, a glowing box, a point or a spot.
fn light(name: &str, half: Vec3, flux: f32, dice: &mut Dice) -> String {
    let tint = dice.color(0.6, 1.0);
    let kind = dice.between(0.0, 1.0);
    let place = Vec3::new(dice.between(-0.6, 0.6), dice.between(1.4, 1.8), dice.between(-0.8, 0.5));
    let place = place * half;
    if kind < 0.75 {
        let (a, b) = (dice.between(0.1, 1.2), dice.between(0.1, 1.2));
        let (area, body) = match kind {
            ..0.5 => {
                let corner = Vec3::new(place.x - 0.5 * a, 2.0 * half.y - 0.01, place.z - 0.5 * b);
                (a * b, quad(name, corner, Vec3::X * a, Vec3::Z * b))
            }
            0.5..0.65 => {
                let corner = Vec3::new(0.01 - half.x, place.y - 0.5 * a, place.z - 0.5 * b);
                (a * b, quad(name, corner, Vec3::Y * a, Vec3::Z * b))
            }
            _ => {
                let size = Vec3::splat(0.05 + 0.15 * a);
                let lines = format!(
                    "[[boxes]]\ncenter = {}\nsize = {}\nmaterial = \"{name}\"\n",
                    list(place),
                    list(size)
                );
                (6.0 * size.x * size.x, lines)
            }
        };
        let emission = list(tint * flux / (PI * area));
        return format!(
            "[materials.{name}]\ntype = \"diffuse\"\nalbedo = 0.6\nemission = {emission}\n{body}"
        );
    }
    let place = list(place);
    if kind < 0.9 {
        let intensity = list(tint * flux / (4.0 * PI));
        return format!(
            "[[lights]]\ntype = \"point\"\nposition = {place}\nintensity = {intensity}\n"
        );
    }
    let target = list(Vec3::new(dice.between(-0.5, 0.5), 0.0, dice.between(-0.5, 0.3)) * half);
    let intensity = list(tint * flux / PI);
    format!(
        "[[lights]]\ntype = \"spot\"\nposition = {place}\ntarget = {target}\nintensity = {intensity}\n\
         cone_angle = 35\nfalloff_angle = 10\n"
    )
}

/// A ball, or a box in it, of any material.
fn thing(name: &str, center: Vec3, radius: f32, dice: &mut Dice) -> String {
    let kind = dice.between(0.0, 1.0);
    let mut lines = format!("[materials.{name}]\n");
    let metal = ["gold", "silver", "copper", "iron"][dice.below(4)];
    let wrote = match kind {
        ..0.45 => write!(lines, "type = \"diffuse\"\nalbedo = {}", list(dice.color(0.1, 0.8))),
        0.45..0.65 => {
            let ior = dice.between(1.3, 1.8);
            let absorption = if dice.happens(0.4) { dice.color(0.0, 2.0) } else { Vec3::ZERO };
            write!(lines, "type = \"glass\"\nior = {ior:.2}\nabsorption = {}", list(absorption))
        }
        0.65..0.8 => write!(lines, "type = \"metal\"\npreset = \"{metal}\""),
        0.8..0.9 => write!(lines, "type = \"mirror\"\nreflectance = 0.9"),
        _ => write!(
            lines,
            "type = \"mirror\"\nreflectance = 0.2\nalbedo = {}",
            list(dice.color(0.1, 0.7))
        ),
    };
    wrote.unwrap();
    lines += "\n";
    let at = list(center);
    if dice.happens(0.5) {
        lines +=
            &format!("[[spheres]]\ncenter = {at}\nradius = {radius:.4}\nmaterial = \"{name}\"\n");
    } else {
        // Its corners would be below the floor if it were turned in any other way.
        let size = Vec3::new(1.0, dice.between(0.4, 2.0), 1.0).normalize() * 2.0 * radius;
        let center = list(Vec3::new(0.0, 0.5 * size.y - radius, 0.0));
        let degrees = dice.between(0.0, 90.0);
        lines += &format!(
            "[[boxes]]\ncenter = {center}\nsize = {}\nmaterial = \"{name}\"\n\
             transform = {{ rotate = {{ axis = [0, 1, 0], degrees = {degrees:.1} }}, translate = {at} }}\n",
            list(size)
        );
    }
    lines
}
