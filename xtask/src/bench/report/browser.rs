//! The report in a real browser, used as a reader would use it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

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

/// The page after its own check, at a width of the window.
fn checked(browser: &Path, page: &Path, profile: &Path, width: u32) -> String {
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
        .args(["--no-first-run", "--disable-background-networking", "--disable-sync"])
        .arg("--host-resolver-rules=MAP * ~NOTFOUND")
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("--window-size={width},900"))
        .args(["--virtual-time-budget=10000", "--dump-dom"])
        .arg(format!("file://{}#selftest", page.display()))
        .stderr(Stdio::null())
        .output()
        .unwrap();
    String::from_utf8(output.stdout).unwrap()
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
    let page = folder.path().join("report.html");
    fs::write(&page, small_page(folder.path())).unwrap();
    for width in [1280, 500] {
        let dom = checked(&browser, &page, &folder.path().join("profile"), width);
        let result = dom.split("<pre id=\"selftest\" hidden=\"\">").nth(1);
        let result =
            result.unwrap_or_else(|| panic!("{} wrote no result:\n{dom}", browser.display()));
        let json = result.split("</pre>").next().unwrap().replace("&lt;", "<").replace("&gt;", ">");
        let checks: BTreeMap<String, bool> =
            serde_json::from_str(&json.replace("&amp;", "&")).unwrap();
        let failed: Vec<_> =
            checks.iter().filter(|(_, holds)| !**holds).map(|(name, _)| name).collect();
        assert!(failed.is_empty(), "{width} pixels wide: {failed:?}");
        // For each of two scenes eight uses of the viewer and seven tables, and two checks of the whole page.
        assert_eq!(checks.len(), 2 * (8 + 7) + 2, "{checks:?}");
    }
}
