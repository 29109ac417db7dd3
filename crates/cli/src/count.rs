//! Counts with K and M.

/// Reads a count such as `500`, `250K`, `1.5M` or `2G`; the letters mean powers of 1000.
///
/// # Errors
/// When the text isn't a count, or isn't a whole number.
pub fn parse_count(text: &str) -> Result<u64, String> {
    let (digits, factor) = match text.char_indices().next_back() {
        Some((i, 'k' | 'K')) => (&text[..i], 1e3),
        Some((i, 'm' | 'M')) => (&text[..i], 1e6),
        Some((i, 'g' | 'G')) => (&text[..i], 1e9),
        _ => (text, 1.0),
    };
    let is_number = digits.chars().all(|c| c.is_ascii_digit() || c == '.') && !digits.is_empty();
    let value = if is_number { digits.parse::<f64>().ok() } else { None };
    let value = value.ok_or("expected a count such as 500, 250K or 1.5M")? * factor;
    if value.round() != value || value > 1e15 {
        return Err("expected a whole number up to 10^15".into());
    }
    Ok(value as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_powers_of_a_thousand() {
        for (text, count) in
            [("0", 0), ("500", 500), ("250K", 250_000), ("1.5M", 1_500_000), ("2g", 2_000_000_000)]
        {
            assert_eq!(parse_count(text), Ok(count));
        }
        for text in ["", "K", "-1", "1e6", "1.0005K", "NaN", "1 M", "inf", "9999999999999999"] {
            assert!(parse_count(text).is_err(), "{text} was read");
        }
    }
}
