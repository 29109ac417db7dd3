//! The report in a real browser, used as a reader would use it.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde::Deserialize;

use crate::bench::gallery::LAYERS;
use crate::bench::report::tests::small_page;

/// A Chromium, from the variable `CHROMIUM` or the search path.
fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let mut found = std::env::split_paths(&path)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .filter(|program| program.is_file());
    named.or_else(|| found.next())
}

/// How long a browser may take for a page; it takes seconds.
const PATIENCE: Duration = Duration::from_secs(120);

/// What the page says of its own check: see `selfTest` in `page.js`.
#[derive(Debug, Deserialize)]
struct Outcome {
    checks: BTreeMap<String, bool>,
    /// By scene: rows, cells, and the texts in a cell.
    pixels: BTreeMap<String, Vec<Vec<Vec<String>>>>,
    errors: Vec<String>,
    dark: bool,
    width: u32,
}

/// Opens the page in a frame, since a window of its own can't be as narrow as a phone, and lets it check itself.
fn checked(browser: &Path, folder: &Path, width: u32, is_dark: bool) -> Outcome {
    let frame = folder.join("frame.html");
    let html = format!(
        "<!doctype html><body><script>\
         addEventListener('message', (event) => {{\
           const result = document.createElement('pre'); result.id = 'result'; result.textContent = event.data;\
           document.body.append(result);\
         }});</script>\
         <iframe width=\"{width}\" height=\"900\" style=\"border: 0\" src=\"report.html#selftest\"></iframe>"
    );
    fs::write(&frame, html).unwrap();
    let dumped = folder.join("dom.html");
    let mut child = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
        .args(["--no-first-run", "--disable-background-networking", "--disable-sync"])
        .args(is_dark.then_some("--force-dark-mode"))
        .arg("--host-resolver-rules=MAP * ~NOTFOUND")
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg("--window-size=1400,1000")
        .args(["--virtual-time-budget=10000", "--dump-dom"])
        .arg(format!("file://{}", frame.display()))
        .stdout(File::create(&dumped).unwrap())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > PATIENCE {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{} hasn't ended within {PATIENCE:?}", browser.display());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let dom = fs::read_to_string(&dumped).unwrap();
    let result =
        dom.split("<pre id=\"result\">").nth(1).and_then(|rest| rest.split("</pre>").next());
    let result = result.unwrap_or_else(|| panic!("{} wrote no result:\n{dom}", browser.display()));
    let json = result.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    serde_json::from_str(&json).unwrap()
}

#[test]
fn slider_zoom_and_tables_work_in_a_browser() {
    let Some(browser) = browser() else {
        eprintln!(
            "skipped: there is no chromium to open the report in; install one (Debian: apt-get install chromium) or name one in CHROMIUM"
        );
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("report.html"), small_page(folder.path())).unwrap();
    for (width, is_dark) in [(1280, false), (1280, true), (390, false)] {
        let outcome = checked(&browser, folder.path(), width, is_dark);
        let Outcome { checks, pixels, errors, dark, .. } = &outcome;
        let failed: Vec<_> = checks.iter().filter(|(_, holds)| !**holds).map(|c| c.0).collect();
        let name = format!("{width} pixels wide, {}", if is_dark { "dark" } else { "light" });
        assert!(failed.is_empty() && errors.is_empty(), "{name}: {failed:?}, {errors:?}");
        assert_eq!((*dark, outcome.width), (is_dark, width));
        // For each of two scenes six uses of the viewer and eight tables; seven colors, and four checks of the whole page.
        assert_eq!(checks.len(), 2 * (6 + 8) + 7 + 4, "{checks:?}");
        assert_eq!(pixels.len(), 2, "{pixels:?}");
        pixels.values().for_each(|cells| check_pixel(cells));
    }
}

/// Holds what the page tells of a pixel against the picture that was made up: see `gallery::tests::picture`.
fn check_pixel(rows: &[Vec<Vec<String>>]) {
    assert_eq!(rows[0], [vec![], vec!["original".to_owned()], vec!["adaptive".to_owned()]]);
    for (i, row) in rows[1..].iter().enumerate() {
        assert_eq!(row[0], [LAYERS[i]]);
        // Pixel 12, 16 of 32 x 32 is 6, 8 of 16 x 16.
        let expected = [i as f64 * 0.1, 6.0 / 100.0, 8.0 / 50.0];
        for (cell, how) in row[1..]
            .iter()
            .zip(["traced, as every pixel", "traced: no neighbors on its surface, step 8"])
        {
            let told: Vec<f64> = cell[0].split(", ").map(|n| n.parse().unwrap()).collect();
            let is_close = |(told, expected): (&f64, f64)| (told - expected).abs() < 0.002;
            assert!(told.len() == 3 && told.iter().zip(expected).all(is_close), "{cell:?}");
            assert_eq!(cell[1], how);
        }
    }
}
