//! One page that opens from disk, with no network: figures, pictures to compare and to look into, tables.

#[cfg(test)]
mod browser;
pub(crate) mod html;

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::bench::environment::Environment;
use crate::bench::figures;
use crate::bench::gallery::{Gallery, LAYERS, Shown};
use crate::bench::paper::printed;
use crate::bench::reasons;
use crate::bench::report::html::{data_uri, escape};
use crate::bench::runs::{Clock, Runs, Saved, SceneRuns};
use crate::bench::tables::{percent, tables, title};

const HEAD: &str = include_str!("report/head.html");
const STYLE: &str = include_str!("report/page.css");
const SCRIPT: &str = include_str!("report/page.js");

/// The page. There is a gallery for each scene.
pub(crate) fn page(environment: &Environment, runs: &Runs, galleries: &[Gallery]) -> String {
    let mut body = header(environment, runs);
    for (scene, gallery) in runs.scenes.iter().zip(galleries) {
        body += &section(runs, scene, gallery);
    }
    body += &method(environment, runs);
    let data =
        json!({ "layers": LAYERS, "scenes": galleries.iter().map(pixel_data).collect::<Vec<_>>() });
    // A closing tag within the data would end it.
    let data = data.to_string().replace('<', "\\u003c");
    format!(
        "{HEAD}<style>\n{STYLE}</style>\n</head>\n<body>\n{body}\n\
         <script type=\"application/json\" id=\"data\">{data}</script>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n"
    )
}

/// Title, and the result in short.
fn header(environment: &Environment, runs: &Runs) -> String {
    let mut html = format!(
        "<header><h1>The paper's tables and figures, measured</h1>\
         <p>Lu and Chang, <cite>Acceleration of Photon Mapping: Adaptive Sampling of Irradiance Cache by Components</cite>, \
         with Tetralux at commit {}. Medians of {} runs in alternation; one photon map for all pictures of a scene: {}.</p>",
        escape(&environment.commit),
        runs.n_runs(),
        runs.settings
    );
    html += "<div class=\"cards\">";
    for scene in &runs.scenes {
        let Some(size) = scene.sizes.last() else { continue };
        for mode in size.modes.iter().skip(1) {
            let saved = |saved| percent(scene.saved(size, mode, saved, Clock::Cpu).median, 1);
            let quality =
                mode.quality.map_or_else(String::new, |q| format!(", mean FLIP {:.4}", q.mean));
            let _ = write!(
                html,
                "<a class=\"card\" href=\"#{0}\"><small>{0}, {1}\u{d7}{1}, {2}</small><strong>{3}</strong>\
                 <span>of the CPU time of pass 2 saved; {4} with pass 1 counted{5}</span></a>",
                escape(&scene.name),
                size.size,
                escape(&mode.mode),
                saved(Saved::Pass2),
                saved(Saved::WithPass1),
                quality
            );
        }
    }
    html + "</div></header>"
}

/// All of a scene.
fn section(runs: &Runs, scene: &SceneRuns, gallery: &Gallery) -> String {
    let name = escape(&scene.name);
    let modes: Vec<&str> = gallery.modes.iter().map(|m| m.mode.as_str()).collect();
    let mut html = format!("<section id=\"{name}\"><h2>{}</h2>", escape(&title(&scene.name)));
    html += "<h3>Time by component</h3>";
    html += &figures::legend(&modes);
    html += "<div class=\"figures\">";
    let mut figure = |caption: &str, svg: String| {
        let _ = write!(
            html,
            "<figure><div class=\"scroll\">{svg}</div><figcaption>{caption}</figcaption></figure>"
        );
    };
    figure(
        "Whole time, pass 1 at the bottom, and the trend of each mode.",
        figures::seconds(scene),
    );
    if let Some(printed) = printed(&scene.name) {
        let caption = format!(
            "The same from {} of the paper, in seconds of its authors' machine.",
            printed.name
        );
        figure(&caption, figures::as_printed(printed));
    }
    figure(
        "Pass 2 alone, for each pixel: a mode gains on larger pictures where its bars sink.",
        figures::per_pixel(scene),
    );
    html += "</div>";
    html += &viewer(&name, gallery);
    html += &origins(gallery);
    html += "<h3>Tables</h3>";
    for table in tables(runs, scene) {
        html += &html::table(&table);
    }
    html + "</section>"
}

/// Two pictures with a slider between them, a pixel of both seen close, and all pictures side by side.
fn viewer(scene: &str, gallery: &Gallery) -> String {
    let mut images = String::from("<div class=\"pictures\">");
    let mut options = String::new();
    let mut picture = |name: &str, title: &str, png: &[u8]| {
        let _ = write!(options, "<option value=\"{name}\">{title}</option>");
        let _ = write!(
            images,
            "<figure><img data-name=\"{name}\" alt=\"The picture: {title}\" src=\"{}\"><figcaption>{title}</figcaption></figure>",
            data_uri(png)
        );
    };
    for Shown { mode, picture: png, .. } in &gallery.modes {
        picture(&escape(mode), &escape(mode), png);
    }
    for Shown { mode, difference, .. } in &gallery.modes {
        if let Some(difference) = difference {
            let mode = escape(mode);
            picture(&format!("difference {mode}"), &format!("difference of {mode}"), difference);
        }
    }
    images += "</div>";
    for Shown { mode, atlas, .. } in &gallery.modes {
        let _ = write!(
            images,
            "<img hidden data-atlas=\"{}\" alt=\"\" src=\"{}\">",
            escape(mode),
            data_uri(atlas)
        );
    }
    let size = gallery.size;
    format!(
        "<h3>Pictures</h3><p>{size}\u{d7}{size}. Move the handle to compare; point at a pixel, tap it, or use the arrow keys to look \
         into it. Differences are FLIP, black for none; pictures and FLIP are one stop brighter than the layers.</p>\
         <div class=\"viewer\" data-scene=\"{scene}\"><div class=\"look\"><div class=\"choice\">\
         <label>left <select class=\"left\">{options}</select></label>\
         <label>right <select class=\"right\">{options}</select></label></div>\
         <div class=\"stage\" tabindex=\"0\" role=\"img\" aria-label=\"Two pictures of the scene, one beside the other\">\
         <canvas class=\"under\" width=\"{size}\" height=\"{size}\"></canvas><canvas class=\"over\" width=\"{size}\" height=\"{size}\"></canvas>\
         <div class=\"edge\"></div><div class=\"mark\"></div></div>\
         <input class=\"slider\" type=\"range\" min=\"0\" max=\"100\" value=\"50\" step=\"0.5\" aria-label=\"Where the left picture ends\">\
         </div><div class=\"zoom\"><div class=\"lenses\"><figure><canvas class=\"lens-left\" width=\"170\" height=\"170\"></canvas>\
         <figcaption></figcaption></figure><figure><canvas class=\"lens-right\" width=\"170\" height=\"170\"></canvas>\
         <figcaption></figcaption></figure></div><p class=\"where\"></p><div class=\"pixel\"></div></div>{images}</div>"
    )
}

/// Where each component was traced, in each cached mode.
fn origins(gallery: &Gallery) -> String {
    let size = gallery.pixels;
    let mut html = format!(
        "<h3>What was traced, and why</h3><p>Of {size}\u{d7}{size} pixels, by component. Dark pixels were interpolated.</p>"
    );
    for Shown { mode, origins, .. } in gallery.modes.iter().filter(|m| m.mode != "original") {
        let _ = write!(html, "<h4>{}</h4><div class=\"origins\">", escape(mode));
        for (layer, (png, shares)) in LAYERS.iter().zip(origins) {
            let traced: f64 =
                shares.iter().filter(|(reason, _)| **reason > 0).map(|(_, share)| share).sum();
            let _ = write!(
                html,
                "<figure><img width=\"{size}\" height=\"{size}\" alt=\"Where {layer} light was traced\" src=\"{}\"><figcaption>{layer}: {} traced</figcaption><ul>",
                data_uri(png),
                percent(traced, 1)
            );
            for (&reason, &share) in shares {
                let [r, g, b] = reasons::color(reason);
                let _ = write!(
                    html,
                    "<li><i style=\"background:rgb({r},{g},{b})\"></i>{} {}</li>",
                    percent(share, 1),
                    escape(&reasons::text(mode, reason))
                );
            }
            html += "</ul></figure>";
        }
        html += "</div>";
    }
    html
}

/// What the script needs to read the pictures.
fn pixel_data(gallery: &Gallery) -> Value {
    let words = |mode: &str| (0..=9).map(|reason| reasons::text(mode, reason)).collect::<Vec<_>>();
    let reasons: serde_json::Map<String, Value> =
        gallery.modes.iter().map(|m| (m.mode.clone(), json!(words(&m.mode)))).collect();
    json!({ "size": gallery.size, "pixels": gallery.pixels, "reasons": reasons })
}

/// How all this was measured.
fn method(environment: &Environment, runs: &Runs) -> String {
    let mut html = String::from("<section id=\"method\"><h2>How this was measured</h2><dl>");
    for (name, value) in environment.lines() {
        let _ = write!(html, "<dt>{name}</dt><dd>{}</dd>", escape(&value));
    }
    html += "</dl><p>For each scene and size, all modes run once to warm up and then in turns, forth and back, so that a \
             machine that slows down is fair to all. The counts in each run's account and the bytes it writes must be those of the \
             first, and its time must be what the system says, else the bench fails. The warm-up writes all layers \
             as EXR; the measured runs write a PNG file only. Seconds are medians; savings are medians over pairs of runs.</p>\
             <details><summary>Command lines</summary><pre>";
    for scene in &runs.scenes {
        let _ = writeln!(html, "{}", escape(&scene.command));
        for mode in scene.sizes.iter().flat_map(|s| &s.modes) {
            let _ = writeln!(html, "{}", escape(&mode.command));
        }
    }
    html + "</pre></details></section>"
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::bench::gallery::tests::small_gallery;
    use crate::bench::runs::tests::records;

    /// A page about runs and pictures that were made up.
    pub(crate) fn small_page(folder: &std::path::Path) -> String {
        let modes = ["original", "paper", "adaptive"];
        let mut all = records("cornell-box", &[16, 32], &modes, 3);
        all.extend(records("rabbit", &[16, 32], &modes, 3));
        let runs = Runs::of(&all).unwrap();
        let galleries: Vec<Gallery> =
            runs.scenes.iter().map(|s| small_gallery(folder, s)).collect();
        page(&environment(), &runs, &galleries)
    }

    /// A machine that was made up.
    pub(crate) fn environment() -> Environment {
        let text = |s: &str| s.to_owned();
        Environment {
            processor: text("Abacus"),
            processors: 2,
            memory: text("8.0 GiB"),
            system: text("Linux"),
            rustc: text("rustc 1.95.0"),
            rustflags: String::new(),
            commit: text("0123456789ab"),
            commit_date: text("2026-01-01T00:00:00Z"),
            command: text("cargo xtask bench"),
        }
    }

    #[test]
    fn the_page_needs_nothing_from_elsewhere() {
        let folder = tempfile::tempdir().unwrap();
        let page = small_page(folder.path());
        for what in ["http://", "https://", "src=\"/", "@import", "url("] {
            assert!(!page.contains(what), "the page has {what}");
        }
        let sources = page.matches(" src=\"").count();
        assert_eq!(sources, page.matches(" src=\"data:image/png;base64,").count());
        // For each scene 3 pictures, 2 differences, 3 atlases, 2 x 4 maps of what was traced.
        assert_eq!(sources, 2 * (3 + 2 + 3 + 8));
        assert_eq!(page.matches("<svg ").count(), 6);
    }
}
