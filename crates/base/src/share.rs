//! A share of work that several processes do.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Share `number` of `of`, counted from 1. Written as `3/8`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "(u32, u32)", into = "(u32, u32)")]
pub struct Share {
    number: u32,
    of: u32,
}

impl Share {
    /// All of it.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Share `number` of `of`, if there is such a one.
    pub fn new(number: u32, of: u32) -> Option<Self> {
        (1..=of).contains(&number).then_some(Self { number, of })
    }

    /// Which one, from 1 to [`Share::of`].
    pub fn number(self) -> u32 {
        self.number
    }

    /// How many there are.
    pub fn of(self) -> u32 {
        self.of
    }

    /// Which of `n` items belong to the share. All shares in order are all items in order; their lengths differ by one at
    /// most.
    pub fn range(self, n: u64) -> Range<u64> {
        let end = |shares: u32| (u128::from(n) * u128::from(shares) / u128::from(self.of)) as u64;
        end(self.number - 1)..end(self.number)
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Share {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers =
            text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        numbers
            .and_then(|(i, n)| Self::new(i, n))
            .ok_or("expected a share such as 3/8, from 1/8 to 8/8")
    }
}

impl TryFrom<(u32, u32)> for Share {
    type Error = &'static str;

    fn try_from((number, of): (u32, u32)) -> Result<Self, Self::Error> {
        Self::new(number, of).ok_or("there is no such share")
    }
}

impl From<Share> for (u32, u32) {
    fn from(share: Share) -> Self {
        (share.number, share.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_in_order_are_everything_in_order() {
        for n in [0, 1, 7, 8, 1000, u64::MAX] {
            for of in [1, 2, 3, 8, 1001] {
                let mut end = 0;
                for number in 1..=of {
                    let range = Share::new(number, of).unwrap().range(n);
                    assert_eq!(range.start, end);
                    let length = range.end - range.start;
                    assert!(length == n / u64::from(of) || length == n / u64::from(of) + 1);
                    end = range.end;
                }
                assert_eq!(end, n);
            }
        }
    }

    #[test]
    fn only_shares_that_exist_are_read() {
        assert_eq!("3/8".parse(), Ok(Share { number: 3, of: 8 }));
        assert_eq!("1/1".parse(), Ok(Share::WHOLE));
        for text in ["0/8", "9/8", "3", "3/", "/8", "0/0", "-1/8", "3/8/1", "a/b", "1/99999999999"]
        {
            assert!(text.parse::<Share>().is_err(), "{text} was read");
        }
    }
}
