//! Journals of `--resume`: the file, whatever its pieces are.
#![no_main]

use cli::{Common, Console, Journal, JournalOptions};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("a.exr.journal", data);
    let output = path.with_extension("");
    let common = Common { quiet: true, ..Common::default() };
    let settings = [("--seed".into(), "0".into())];
    let options = JournalOptions { resume: true, checkpoint: 1e-6 };
    let console = Console::new("fuzz", &common);
    let Ok(journal) = Journal::open(Some(&output), options, &common, &settings, console) else { return };
    for index in 0..4 {
        std::hint::black_box(journal.get(0, index));
    }
    journal.put(9, 9, b"more");
    journal.remove();
});
