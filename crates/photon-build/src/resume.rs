//! `--resume`: batches of photons in a journal.

use base::{Photon, Rgb};
use cli::Journal;
use photon_trace::{Account, Energy, Keeper, Traced};

/// Numbers before the photons of a piece.
const WORDS: usize = 14;

/// Bytes of a photon.
const PHOTON: usize = 26;

/// More rays than any batch needs, and few enough that those of all batches are a number.
const MOST_RAYS: u64 = 1 << 40;

/// Calls `trace` with a keeper that finds batches in a journal, and keeps them there.
pub(crate) fn with_keeper<T>(journal: &Journal, trace: impl FnOnce(&Keeper<'_>) -> T) -> T {
    let number = |batch: u64| u32::try_from(batch).ok();
    trace(&Keeper {
        find: &|batch, n| decode(&journal.get(0, number(batch)?)?, n),
        keep: &|batch, traced| {
            if let Some(number) = number(batch) {
                journal.put(0, number, &encode(traced));
            }
        },
    })
}

fn encode(traced: &Traced) -> Vec<u8> {
    let Account { emitted, absorbed, escaped, cut, rays, energy: e, .. } = traced.account;
    let sets = [&traced.direct, &traced.caustic, &traced.indirect, &traced.focused];
    let watts = [e.emitted, e.absorbed, e.escaped, e.cut, e.gained].map(f64::to_bits);
    let lens = sets.map(|set| set.len() as u64);
    let words = [emitted, absorbed, escaped, cut, rays].into_iter().chain(watts).chain(lens);
    let n: usize = sets.iter().map(|set| set.len()).sum();
    let mut bytes = Vec::with_capacity(WORDS * 8 + n * PHOTON);
    bytes.extend(words.flat_map(u64::to_le_bytes));
    for Photon { position: p, normal, flux } in sets.into_iter().flatten() {
        bytes
            .extend([p.x, p.y, p.z, flux.r, flux.g, flux.b].into_iter().flat_map(f32::to_le_bytes));
        bytes.extend(normal.to_le_bytes());
    }
    bytes
}

/// The batch, if these are the bytes of one that emits `n` photons. A journal may come from anywhere.
fn decode(bytes: &[u8], n: u64) -> Option<Traced> {
    let (words, photons) = bytes.split_at_checked(WORDS * 8)?;
    let words: Vec<u64> =
        words.as_chunks().0.iter().map(|&word| u64::from_le_bytes(word)).collect();
    let watt = |i: usize| f64::from_bits(words[i]);
    let account = Account {
        emitted: words[0],
        absorbed: words[1],
        escaped: words[2],
        cut: words[3],
        rays: words[4],
        flux: Rgb::BLACK,
        energy: Energy {
            emitted: watt(5),
            absorbed: watt(6),
            escaped: watt(7),
            cut: watt(8),
            gained: watt(9),
        },
    };
    let (photons, []) = photons.as_chunks::<PHOTON>() else { return None };
    let lens = [10, 11, 12, 13].map(|i| usize::try_from(words[i]).unwrap_or(usize::MAX));
    let total = lens.into_iter().try_fold(0_usize, usize::checked_add);
    let ends = [account.absorbed, account.escaped, account.cut];
    let ended = ends.into_iter().try_fold(0_u64, u64::checked_add);
    let is_sound = account.emitted == n && ended == Some(n) && account.rays <= MOST_RAYS;
    if !is_sound || total != Some(photons.len()) {
        return None;
    }
    let all: Vec<Photon> = photons.iter().map(photon).collect();
    let (direct, rest) = all.split_at(lens[0]);
    let (caustic, rest) = rest.split_at(lens[1]);
    let (indirect, focused) = rest.split_at(lens[2]);
    Some(Traced {
        direct: direct.to_vec(),
        caustic: caustic.to_vec(),
        indirect: indirect.to_vec(),
        focused: focused.to_vec(),
        account,
    })
}

fn photon(bytes: &[u8; PHOTON]) -> Photon {
    let float = |i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|k| bytes[4 * i + k]));
    Photon {
        position: [float(0), float(1), float(2)].into(),
        normal: u16::from_le_bytes([bytes[24], bytes[25]]),
        flux: Rgb::new(float(3), float(4), float(5)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_that_no_batch_can_have_are_not_taken_up() {
        let photon = Photon { position: [1.0, 2.0, 3.0].into(), normal: 5, flux: Rgb::ONE };
        let account =
            Account { emitted: 7, absorbed: 4, escaped: 2, cut: 1, rays: 30, ..Account::default() };
        let batch =
            |account: Account| Traced { indirect: vec![photon], account, ..Traced::default() };
        let bytes = encode(&batch(account));
        let found = decode(&bytes, 7).unwrap();
        assert_eq!((found.account.absorbed, &*found.indirect), (4, &[photon][..]));
        assert!(decode(&bytes, 8).is_none());
        assert!(decode(&bytes[..bytes.len() - 1], 7).is_none());
        for forged in [
            Account { absorbed: 5, ..account },
            Account { escaped: u64::MAX, ..account },
            Account { rays: u64::MAX, ..account },
        ] {
            assert!(decode(&encode(&batch(forged)), 7).is_none());
        }
    }
}
