//! Maps that are not as they were written.

use crate::bench::Bench;

/// A map small enough to be damaged in many ways, and what `info` says of a damaged one.
fn damaged(bench: &Bench, content: &[u8]) -> String {
    bench.write("bad.photons", content);
    let output = bench.command("info bad.photons").output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert_eq!(output.stdout, b"");
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(message.lines().count(), 1, "{message}");
    message
}

fn map(bench: &Bench) -> Vec<u8> {
    bench.run("scene.toml --photons 300 --store direct -o good.photons");
    let map = bench.read("good.photons");
    assert!(map.len() < 20_000, "{}", map.len());
    map
}

const REMEDY: &str = "make it anew with: photon-build scene.toml -o 'bad.photons' --photons 300 --seed 0 --max-bounces 1024 --store direct --force";

#[test]
fn a_map_that_was_cut_is_refused() {
    let bench = Bench::new();
    let map = map(&bench);
    let header = map.windows(2).position(|pair| pair == b"\n\n").unwrap() + 2;
    assert_eq!(
        damaged(&bench, &[]),
        "photon-build: bad.photons is not a map: its first line is not `#?tetralux-map`; check the name\n"
    );
    assert_eq!(
        damaged(&bench, &map[..header - 1]),
        format!(
            "photon-build: bad.photons is damaged: the header does not end with a blank line (byte {}); make it anew\n",
            header - 1
        )
    );
    assert_eq!(
        damaged(&bench, &map[..header]),
        format!(
            "photon-build: bad.photons is damaged: the file ends before its metadata does (byte {header}); {REMEDY}\n"
        )
    );
    // Sections begin at multiples of 64: these are all boundaries, and more.
    let starts = (header.next_multiple_of(64)..map.len()).step_by(64);
    for end in starts.chain([map.len() - 1]) {
        let message = damaged(&bench, &map[..end]);
        assert!(message.starts_with("photon-build: bad.photons is damaged: "), "{message}");
        assert!(message.ends_with(&format!("; {REMEDY}\n")), "{message}");
    }
}

#[test]
fn a_flipped_bit_is_found_in_every_section() {
    let bench = Bench::new();
    let map = map(&bench);
    let mut sections = std::collections::BTreeSet::new();
    for start in (0..map.len()).step_by(64) {
        let mut bad = map.clone();
        // The shortest sections have four bytes in the beginning of a block.
        let at = (start + start / 64 % 4).min(map.len() - 1);
        bad[at] ^= 1 << (start / 64 % 8);
        let message = damaged(&bench, &bad);
        let what = message.strip_prefix("photon-build: bad.photons is ").unwrap();
        assert!(what.starts_with("damaged: ") || start == 0, "{message}");
        sections.insert(what.split(['(', ';']).next().unwrap().to_owned());
    }
    for class in ["direct", "caustic", "indirect"] {
        for array in ["splits", "boxes", "leaves"] {
            let found = format!("damaged: section `{class}.{array}` does not match its digest ");
            assert!(sections.contains(&found), "{found} of {sections:?}");
        }
    }
    assert!(sections.contains("damaged: the metadata does not match its digest "), "{sections:?}");
    assert!(sections.contains("damaged: the header does not match its digest "), "{sections:?}");
}

#[test]
fn what_follows_the_end_is_refused() {
    let bench = Bench::new();
    let mut map = map(&bench);
    map.push(0);
    let message = damaged(&bench, &map);
    assert!(message.ends_with(&format!("; {REMEDY}\n")), "{message}");
}
