//! Twenty rooms: the error that is told is the error that is made.

use super::bench::{Bench, metadata};
use super::rooms::room;

const TARGET: f64 = 0.01;

/// The least and the most that the error told may be of the true one.
const HONEST: std::ops::RangeInclusive<f64> = 0.7..=1.3;

/// In so many of the twenty rooms at least.
const N_HONEST: usize = 19;

#[test]
fn the_error_that_is_told_is_the_error_that_is_made() {
    let (mut faults, mut n_honest) = (Vec::new(), 0);
    for number in 0..20 {
        let bench = Bench::of_text(&room(number), "100K");
        let pair = bench.both(&format!("--resolution 192x192 --shadow-rays 16 --error {TARGET}"));
        let told = metadata(&pair.adaptive)["error"]["measured_mean"].as_f64().unwrap();
        let made = pair.difference("").flip.mean;
        let line = format!("room {number}: told {told:.5}, made {made:.5} for {TARGET}");
        println!("{line}");
        let is_honest = HONEST.contains(&(told / made));
        n_honest += usize::from(is_honest);
        if !is_honest || made > 2.0 * TARGET {
            let folder = pair.show(&format!("adaptive-room-{number:02}"), "");
            faults.push(format!("{line}, see {}", folder.display()));
        }
        assert!(made <= 2.0 * TARGET, "{}", faults.join("\n"));
    }
    assert!(n_honest >= N_HONEST, "{n_honest} of 20\n{}", faults.join("\n"));
}
