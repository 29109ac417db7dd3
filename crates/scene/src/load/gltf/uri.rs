//! What a URI in the JSON stands for: bytes of its own or a file.

/// Where bytes are.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Uri {
    /// In the URI itself.
    Data(Vec<u8>),
    /// In a file, relative to that of the scene.
    File(String),
}

/// Reads a URI; or why it can't be, in words.
pub(super) fn parse(uri: &str) -> Result<Uri, String> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let Some((kind, data)) = rest.split_once(',') else {
            return Err("the data URI has no comma before its data".into());
        };
        if kind.ends_with(";base64") {
            return base64(data.as_bytes()).map(Uri::Data);
        }
        return Ok(Uri::Data(percent(data)));
    }
    if let Some((scheme, _)) = uri.split_once("://") {
        return Err(format!("nothing is loaded by {scheme}://; save it beside the scene"));
    }
    String::from_utf8(percent(uri))
        .map(Uri::File)
        .map_err(|_| "the URI isn't UTF-8 once its percent signs are resolved".into())
}

/// The bytes behind base64 (RFC 4648, section 4).
fn base64(text: &[u8]) -> Result<Vec<u8>, String> {
    let digits = text.trim_ascii_end();
    let digits = digits.strip_suffix(b"==").or(digits.strip_suffix(b"=")).unwrap_or(digits);
    if digits.len() % 4 == 1 {
        return Err("the base64 of the data URI is cut off".into());
    }
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    for group in digits.chunks(4) {
        let mut bits = 0_u32;
        for (i, digit) in group.iter().enumerate() {
            let value = match digit {
                b'A'..=b'Z' => digit - b'A',
                b'a'..=b'z' => digit - b'a' + 26,
                b'0'..=b'9' => digit - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return Err(format!("the data URI holds the byte {digit}, no base64")),
            };
            bits |= u32::from(value) << (18 - 6 * i);
        }
        bytes.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    Ok(bytes)
}

/// The bytes behind `%20` and the like (RFC 3986, section 2.1); what isn't such stays.
fn percent(text: &str) -> Vec<u8> {
    let mut rest = text.as_bytes();
    let mut bytes = Vec::with_capacity(rest.len());
    let digit = |byte: u8| char::from(byte).to_digit(16);
    while let [first, behind @ ..] = rest {
        rest = behind;
        let escaped = match (first, behind) {
            (b'%', [a, b, ..]) => digit(*a).zip(digit(*b)),
            _ => None,
        };
        match escaped {
            Some((a, b)) => {
                bytes.push((a * 16 + b) as u8);
                rest = &behind[2..];
            }
            None => bytes.push(*first),
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_are_bytes_or_files() {
        let data = |text: &str| parse(&format!("data:application/octet-stream;base64,{text}"));
        // RFC 4648, section 10.
        for (text, bytes) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg", "foob"),
            ("Zm9vYmE=", "fooba"),
            ("Zm9vYmFy\n", "foobar"),
        ] {
            assert_eq!(data(text), Ok(Uri::Data(bytes.into())), "{text}");
        }
        assert_eq!(data("+/+/"), Ok(Uri::Data(vec![0xfb, 0xff, 0xbf])));
        for bad in ["Zm9vY", "Zm=v", "Zm 9", "Z"] {
            assert!(data(bad).is_err(), "{bad}");
        }
        assert_eq!(parse("data:,a%20b"), Ok(Uri::Data(b"a b".to_vec())));
        assert!(parse("data:text").is_err());
        let file = |name: &str| Ok(Uri::File(name.into()));
        assert_eq!(parse("a%20b/%C3%A4.bin"), file("a b/ä.bin"));
        assert_eq!(parse("100%.bin"), file("100%.bin"));
        assert_eq!(parse("%4"), file("%4"));
        assert!(parse("%ff").is_err());
        assert!(parse("https://example.com/a.bin").unwrap_err().contains("https://"));
    }
}
