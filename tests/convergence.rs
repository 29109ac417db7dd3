//! The density estimate converges as theory says: four times the photons, with four times as many in each estimate, halve
//! its noise.

use base::{Component, ImageSize, Rgb};
use photon_map::{Gather, Kernel};
use scene::{Material, Scene};
use shade::{Settings, Shader};

use crate::renderer;
use crate::scenes::{emissive, furnace};

/// Root of the mean square error of indirect light in a furnace, as a share of it, over several maps.
fn error(photons: u64, k: usize) -> f64 {
    let rho = 0.6;
    let expected = f64::from(rho * rho / (1.0 - rho));
    let scene =
        Scene::assemble(furnace(Material { albedo: Rgb::splat(rho), ..emissive(Rgb::ONE) }));
    let gather = Gather { k, max_radius: 1.0, kernel: Kernel::Epanechnikov };
    let (mut squares, mut n) = (0.0, 0.0);
    for seed in 0..4 {
        let maps = renderer::photons(&scene, photons, seed);
        let settings =
            Settings { shadow_rays: 1, glossy_rays: 1, indirect: gather, caustic: gather, seed };
        let shader = Shader::new(&scene, &maps, settings);
        let picture = renderer::original(&shader, ImageSize { width: 32, height: 32 });
        for color in picture.components[Component::Indirect].values() {
            squares += (f64::from(color.g) / expected - 1.0).powi(2);
            n += 1.0;
        }
    }
    (squares / n).sqrt()
}

#[test]
fn four_times_the_photons_in_an_estimate_halve_its_noise() {
    // The radius stays, so there is nothing but noise: of 100 photons 11.5 % (1.15 over the root of k), a little more in
    // corners.
    let errors = [(25_000, 25), (100_000, 100), (400_000, 400)].map(|(n, k)| error(n, k));
    println!("errors {errors:?}");
    assert!((0.11..0.15).contains(&errors[1]), "{errors:?}");
    for pair in errors.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((1.75..2.25).contains(&ratio), "{ratio} of {errors:?}");
    }
}
