//! Figures 3 and 4: stacked bars by component for each picture size, with a line through the totals of each mode.

use std::fmt::Write as _;

use crate::bench::paper::{Printed, PrintedTimes};
use crate::bench::report::html::escape;
use crate::bench::runs::{Clock, ModeRuns, Row, SceneRuns};

/// The parts of a bar from bottom to top, as in the paper: pass 1, then the components, caustics above all. Colors are
/// classes of the page's style sheet.
const PARTS: [(Row, &str); 8] = [
    (Row::Pass1, "pass1"),
    (Row::Rest, "rest"),
    (Row::EyeRays, "eye"),
    (Row::Cache, "cache"),
    (Row::Direct, "direct"),
    (Row::Indirect, "indirect"),
    (Row::Specular, "specular"),
    (Row::Caustics, "caustic"),
];

/// Bars side by side.
struct Group {
    label: String,
    bars: Vec<Bar>,
}

/// A bar: its mode, its parts from bottom to top, and what its top is called.
struct Bar {
    mode: String,
    parts: Vec<(Row, f64)>,
}

/// CPU seconds of a scene, as in the paper's figures.
pub(crate) fn seconds(scene: &SceneRuns) -> String {
    let groups = groups(scene, |mode, _, row| scene.seconds(mode, row, Clock::Cpu).median);
    chart("CPU seconds", &groups)
}

/// CPU microseconds of pass 2 for each pixel, so that small pictures can be compared with large ones.
pub(crate) fn per_pixel(scene: &SceneRuns) -> String {
    let groups = groups(scene, |mode, size, row| match row {
        Row::Pass1 => 0.0,
        _ => scene.seconds(mode, row, Clock::Cpu).median * 1e6 / f64::from(size).powi(2),
    });
    chart("CPU microseconds a pixel", &groups)
}

/// The paper's own figure, from its table.
pub(crate) fn as_printed(printed: &Printed) -> String {
    let bar = |mode: &str, times: &PrintedTimes| {
        let parts = vec![
            (Row::Pass1, times.pass_1),
            (Row::Direct, times.direct),
            (Row::Indirect, times.indirect),
            (Row::Specular, times.specular),
            (Row::Caustics, times.caustics),
        ];
        Bar { mode: mode.into(), parts }
    };
    let groups: Vec<Group> = printed
        .columns
        .iter()
        .map(|c| Group {
            label: label(c.size),
            bars: vec![bar("original", &c.original), bar("paper", &c.cached)],
        })
        .collect();
    chart("seconds, as printed", &groups)
}

/// The legend of all charts: parts of the bars from top to bottom, then the modes.
pub(crate) fn legend(modes: &[&str]) -> String {
    let mut html = String::from("<ul class=\"legend\">");
    for (row, class) in PARTS.iter().rev() {
        let _ = write!(html, "<li><i class=\"fill-{class}\"></i>{}</li>", row.name());
    }
    for mode in modes {
        let _ =
            write!(html, "<li><i class=\"line fill-mode-{0}\"></i>total, {0}</li>", escape(mode));
    }
    html + "</ul>"
}

fn label(size: u32) -> String {
    format!("{size}\u{d7}{size}")
}

fn groups(scene: &SceneRuns, value: impl Fn(&ModeRuns, u32, Row) -> f64) -> Vec<Group> {
    let bar = |mode: &ModeRuns, size| {
        let parts = PARTS.iter().map(|&(row, _)| (row, value(mode, size, row))).collect();
        Bar { mode: mode.mode.clone(), parts }
    };
    let group = |size: &crate::bench::runs::SizeRuns| Group {
        label: label(size.size),
        bars: size.modes.iter().map(|mode| bar(mode, size.size)).collect(),
    };
    scene.sizes.iter().map(group).collect()
}

impl Bar {
    fn total(&self) -> f64 {
        self.parts.iter().map(|(_, value)| value).sum()
    }
}

/// In units of the drawing, which a phone shows at three quarters of a pixel each.
const WIDTH: f64 = 500.0;
const HEIGHT: f64 = 330.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 8.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 36.0;

fn chart(unit: &str, groups: &[Group]) -> String {
    let largest = groups.iter().flat_map(|g| &g.bars).map(Bar::total).fold(0.0, f64::max);
    let step = step(largest);
    let ceiling = (largest / step).ceil().max(1.0) * step;
    let y = |value: f64| HEIGHT - BOTTOM - value / ceiling * (HEIGHT - BOTTOM - TOP);

    let mut svg = format!(
        "<svg class=\"chart\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{0}\"><text class=\"unit\" x=\"4\" y=\"14\">{0}</text>",
        escape(unit)
    );
    let digits = usize::from(step < 1.0) + usize::from(step < 0.1);
    for i in 0..=(ceiling / step).round() as u32 {
        let value = f64::from(i) * step;
        let at = y(value);
        let _ = write!(
            svg,
            "<path class=\"grid\" d=\"M{LEFT} {at:.1}H{}\"/><text class=\"tick\" x=\"{}\" y=\"{:.1}\">{value:.digits$}</text>",
            WIDTH - RIGHT,
            LEFT - 6.0,
            at + 4.0
        );
    }

    let slot = (WIDTH - LEFT - RIGHT) / groups.len().max(1) as f64;
    let mut lines: Vec<(&str, String)> = Vec::new();
    let mut labels = String::new();
    for (i, group) in groups.iter().enumerate() {
        let start = LEFT + slot * i as f64;
        let width = (slot * 0.9 / group.bars.len().max(1) as f64).min(64.0);
        let first = start + (slot - width * group.bars.len() as f64) / 2.0;
        for (j, bar) in group.bars.iter().enumerate() {
            let x = first + width * j as f64;
            draw_bar(&mut svg, bar, &group.label, unit, [x + width * 0.08, width * 0.84], &y);
            let middle = x + width / 2.0;
            let top = y(bar.total());
            let _ = write!(
                labels,
                "<text class=\"total\" x=\"{middle:.1}\" y=\"{:.1}\">{}</text>",
                top - 6.0,
                short(bar.total())
            );
            let point = format!("{middle:.1},{top:.1} ");
            match lines.iter_mut().find(|(mode, _)| *mode == bar.mode) {
                Some((_, points)) => *points += &point,
                None => lines.push((&bar.mode, point)),
            }
        }
        let _ = write!(
            svg,
            "<text class=\"group\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            start + slot / 2.0,
            HEIGHT - 8.0,
            escape(&group.label)
        );
    }
    for (mode, points) in &lines {
        let _ = write!(
            svg,
            "<polyline class=\"trend mode-{}\" points=\"{}\"/>",
            escape(mode),
            points.trim_end()
        );
    }
    svg + &labels + "</svg>"
}

/// The parts of a bar, and the color of its mode below it.
fn draw_bar(
    svg: &mut String,
    bar: &Bar,
    group: &str,
    unit: &str,
    [x, width]: [f64; 2],
    y: &dyn Fn(f64) -> f64,
) {
    let mut below = 0.0;
    for (row, value) in bar.parts.iter().filter(|(_, value)| *value > 0.0) {
        let class = PARTS.iter().find(|(r, _)| r == row).map_or("rest", |(_, class)| class);
        let (top, bottom) = (y(below + value), y(below));
        let _ = write!(
            svg,
            "<rect class=\"fill-{class}\" x=\"{x:.1}\" y=\"{top:.2}\" width=\"{width:.1}\" height=\"{:.2}\"><title>{}, {}: {} {} {}</title></rect>",
            bottom - top,
            escape(group),
            escape(&bar.mode),
            row.name().to_lowercase(),
            crate::bench::tables::seconds(*value),
            escape(unit)
        );
        below += value;
    }
    let _ = write!(
        svg,
        "<rect class=\"fill-mode-{}\" x=\"{x:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"4\"/>",
        escape(&bar.mode),
        y(0.0) + 3.0
    );
}

/// Three digits, or as many as stand before the point.
fn short(value: f64) -> String {
    let digits = match value {
        v if v < 10.0 => 2,
        v if v < 100.0 => 1,
        _ => 0,
    };
    format!("{value:.digits$}")
}

/// A round distance between ticks, for five of them or so.
fn step(largest: f64) -> f64 {
    if largest <= 0.0 {
        return 1.0;
    }
    let decade = 10.0_f64.powf((largest / 5.0).log10().floor());
    let of_decade = largest / 5.0 / decade;
    [1.0, 2.0, 5.0, 10.0].into_iter().find(|&s| of_decade <= s).unwrap_or(10.0) * decade
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::paper::printed;
    use crate::bench::runs::Runs;
    use crate::bench::runs::tests::records;

    #[test]
    fn ticks_are_round() {
        assert_eq!([0.0, 1.0, 4.0, 11.0, 1588.0].map(step), [1.0, 0.2, 1.0, 5.0, 500.0]);
    }

    #[test]
    fn bars_are_as_high_as_their_times() {
        let svg = as_printed(printed("cornell-box").unwrap());
        let heights: Vec<f64> = svg
            .split("<rect class=\"fill-")
            .filter(|rect| rect.contains("1024\u{d7}1024, original"))
            .map(|rect| {
                let height = rect.split("height=\"").nth(1).unwrap();
                height.split('"').next().unwrap().parse().unwrap()
            })
            .collect();
        // Of a scale to 2000 s on 264 units: pass 1, direct, indirect, specular, caustics.
        let expected = [17.12, 1364.48, 58.24, 136.24, 12.47].map(|s| s / 2000.0 * 264.0);
        assert_eq!(heights.len(), 5, "{heights:?}");
        for (height, expected) in heights.iter().zip(expected) {
            assert!((height - expected).abs() < 0.02, "{height} instead of {expected}");
        }
    }

    #[test]
    fn every_mode_has_a_line_through_all_sizes() {
        let records = records("rabbit", &[128, 256, 512], &["original", "paper"], 1);
        let runs = Runs::of(&records).unwrap();
        for svg in [seconds(&runs.scenes[0]), per_pixel(&runs.scenes[0])] {
            for mode in ["original", "paper"] {
                let line =
                    svg.split(&format!("class=\"trend mode-{mode}\" points=\"")).nth(1).unwrap();
                assert_eq!(line.split('"').next().unwrap().split(' ').count(), 3, "{line}");
            }
        }
    }
}
