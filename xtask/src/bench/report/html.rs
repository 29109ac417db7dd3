//! Text and tables for a page.

use std::fmt::Write as _;

use crate::table::Table;

/// The text with the characters replaced that mean something in HTML.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&#39;",
            c => escaped.push(c),
        }
    }
    escaped
}

/// A table with its caption, a button that copies it, and its notes.
pub(crate) fn table(table: &Table) -> String {
    let mut html = String::from("<div class=\"table\"><div class=\"scroll\"><table><caption>");
    let _ = write!(html, "{}</caption><thead>", escape(&table.caption));
    if !table.groups.is_empty() {
        html += "<tr><td></td>";
        for (name, span) in &table.groups {
            let _ = write!(
                html,
                "<th class=\"group\" colspan=\"{span}\" scope=\"colgroup\">{}</th>",
                escape(name)
            );
        }
        html += "</tr>";
    }
    // The first column of a group is set apart.
    let mut starts = vec![];
    let mut column = 1;
    for (_, span) in &table.groups {
        starts.push(column);
        column += span;
    }
    let class = |column: usize| if starts.contains(&column) { " class=\"first\"" } else { "" };
    html += "<tr>";
    for (i, cell) in table.header.iter().enumerate() {
        let _ = match i {
            0 => write!(html, "<td>{}</td>", escape(cell)),
            i => write!(html, "<th scope=\"col\"{}>{}</th>", class(i), escape(cell)),
        };
    }
    html += "</tr></thead><tbody>";
    for row in &table.rows {
        let is_total = row[0].starts_with("Total") || row[0].starts_with("Saved");
        html += if is_total { "<tr class=\"strong\">" } else { "<tr>" };
        for (i, cell) in row.iter().enumerate() {
            let _ = match i {
                0 => write!(html, "<th scope=\"row\">{}</th>", escape(cell)),
                i => write!(html, "<td{}>{}</td>", class(i), escape(cell)),
            };
        }
        html += "</tr>";
    }
    html += "</tbody></table></div><div class=\"below\"><button type=\"button\" class=\"copy\">Copy table</button>";
    for note in &table.notes {
        let _ = write!(html, "<p>{}</p>", escape(note));
    }
    html + "</div></div>"
}

/// Bytes as the address of themselves.
pub(crate) fn data_uri(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", base64(png))
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= chunk.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_rfc_4648() {
        let pairs =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")];
        for (bytes, text) in pairs {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    #[test]
    fn nothing_in_a_table_becomes_markup() {
        let mut t = Table::new("a < b & \"c\"", ["", "<i>"]);
        t.push("'x'", ["&amp;".to_owned()]);
        t.groups = vec![("g>h".into(), 1)];
        let html = table(&t);
        for text in
            ["a &lt; b &amp; &quot;c&quot;", "&lt;i&gt;", "&#39;x&#39;", "&amp;amp;", "g&gt;h"]
        {
            assert!(html.contains(text), "{text} isn't in {html}");
        }
    }
}
