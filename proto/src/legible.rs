//! Texts that people read about each other: what they show is what they are. Whatever cannot be seen could make two
//! names look alike, or show one where another stands.

use crate::validate::FieldError;

/// What nobody sees, or what turns the order of the text around it: first and last of each range. These are the
/// controls, what Unicode calls format, white space but the plain blank, and default ignorable; and three signs whose
/// shape is empty.
const UNSEEN: [(char, char); 26] = [
    ('\0', '\u{1f}'),
    ('\u{7f}', '\u{a0}'),
    ('\u{ad}', '\u{ad}'),
    ('\u{34f}', '\u{34f}'),
    ('\u{61c}', '\u{61c}'),
    ('\u{115f}', '\u{1160}'),
    ('\u{1680}', '\u{1680}'),
    ('\u{17b4}', '\u{17b5}'),
    ('\u{180b}', '\u{180f}'),
    ('\u{2000}', '\u{200f}'),
    ('\u{2028}', '\u{202f}'),
    ('\u{205f}', '\u{206f}'),
    // A pattern of Braille without a dot.
    ('\u{2800}', '\u{2800}'),
    ('\u{3000}', '\u{3000}'),
    ('\u{3164}', '\u{3164}'),
    ('\u{fe00}', '\u{fe0f}'),
    ('\u{feff}', '\u{feff}'),
    ('\u{ffa0}', '\u{ffa0}'),
    ('\u{fff0}', '\u{fffb}'),
    ('\u{13430}', '\u{1343f}'),
    // A filler of Khitan.
    ('\u{16fe4}', '\u{16fe4}'),
    ('\u{1bca0}', '\u{1bca3}'),
    // The head of a note that has none.
    ('\u{1d159}', '\u{1d159}'),
    ('\u{1d173}', '\u{1d17a}'),
    ('\u{e0000}', '\u{e0fff}'),
    ('\u{f0000}', '\u{10ffff}'),
];

/// Checks a text at `pointer`: 1 to `most` characters, each of which is seen, and not of blanks alone.
pub(crate) fn check_text(pointer: &str, text: &str, most: usize) -> Result<(), FieldError> {
    check_length(pointer, text, most)?;
    if let Some(character) = text.chars().find(|character| !is_seen(*character)) {
        let code = u32::from(character);
        let detail =
            format!("it has U+{code:04X}, which cannot be seen or moves what is around it");
        return Err(FieldError::new(pointer, detail));
    }
    if text.trim_matches(' ').is_empty() {
        return Err(FieldError::new(pointer, "nothing in it can be seen"));
    }
    Ok(())
}

/// Checks a text at `pointer` by which somebody is told from others: as [`check_text`], and without blanks that nobody
/// notices.
pub(crate) fn check_name(pointer: &str, name: &str, most: usize) -> Result<(), FieldError> {
    check_text(pointer, name, most)?;
    if name.starts_with(' ') || name.ends_with(' ') || name.contains("  ") {
        return Err(FieldError::new(
            pointer,
            "it begins or ends with a blank, or has several in a row",
        ));
    }
    Ok(())
}

/// Checks that a text at `pointer` has 1 to `most` characters.
pub(crate) fn check_length(pointer: &str, text: &str, most: usize) -> Result<(), FieldError> {
    let length = text.chars().count();
    if length == 0 || most < length {
        return Err(FieldError::new(
            pointer,
            format!("{length} characters, wanted 1 to {most}"),
        ));
    }
    Ok(())
}

/// A text that passes [`check_name`], whatever came: what cannot be seen is a blank, of blanks one is left between
/// words, what is too long is cut off, and where nothing is left, it is `otherwise`.
pub(crate) fn fitted(text: &str, most: usize, otherwise: &str) -> String {
    let words = text.split(|character| character == ' ' || !is_seen(character));
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    let fitting: String = words.join(" ").chars().take(most).collect();
    match fitting.trim_end_matches(' ') {
        "" => otherwise.to_owned(),
        fitting => fitting.to_owned(),
    }
}

fn is_seen(character: char) -> bool {
    !UNSEEN
        .iter()
        .any(|(first, last)| (*first..=*last).contains(&character))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `Default_Ignorable_Code_Point` of Unicode 16, DerivedCoreProperties.txt, as first and last.
    const DEFAULT_IGNORABLE: [(u32, u32); 17] = [
        (0xad, 0xad),
        (0x34f, 0x34f),
        (0x61c, 0x61c),
        (0x115f, 0x1160),
        (0x17b4, 0x17b5),
        (0x180b, 0x180f),
        (0x200b, 0x200f),
        (0x202a, 0x202e),
        (0x2060, 0x206f),
        (0x3164, 0x3164),
        (0xfe00, 0xfe0f),
        (0xfeff, 0xfeff),
        (0xffa0, 0xffa0),
        (0xfff0, 0xfff8),
        (0x1bca0, 0x1bca3),
        (0x1d173, 0x1d17a),
        (0xe0000, 0xe0fff),
    ];
    /// What is format (`Cf`) besides, UnicodeData.txt, but for signs of Arabic, Syriac and Kaithi that are seen.
    const FORMAT: [(u32, u32); 2] = [(0xfff9, 0xfffb), (0x13430, 0x1343f)];
    /// The last two planes are for private use: no machine shows anything of them.
    const PRIVATE: [(u32, u32); 1] = [(0xf0000, 0x0010_ffff)];
    /// Empty by their shape alone, which no list of Unicode's tells: Braille, Khitan, music.
    const EMPTY: [(u32, u32); 3] = [(0x2800, 0x2800), (0x16fe4, 0x16fe4), (0x1d159, 0x1d159)];

    /// Against Unicode's own lists, both ways: what is refused is on one of them, and what is on one is refused. Two
    /// are the standard library's, `Cc` and `White_Space`.
    #[test]
    fn what_unicode_calls_unseen_is_refused_and_nothing_else() {
        let lists = [&DEFAULT_IGNORABLE[..], &FORMAT, &PRIVATE, &EMPTY].concat();
        let (mut seen, mut unseen) = (0, 0);
        for character in '\0'..=char::MAX {
            let code = u32::from(character);
            let is_listed = lists
                .iter()
                .any(|(first, last)| (*first..=*last).contains(&code));
            let is_blank = character.is_whitespace() && character != ' ';
            let wanted = is_listed || is_blank || character.is_control();
            let name = format!("a{character}b");
            assert_eq!(
                check_name("/name", &name, 64).is_ok(),
                !wanted,
                "U+{code:04X}"
            );
            *if wanted { &mut unseen } else { &mut seen } += 1;
        }
        assert!(135_000 < unseen && 900_000 < seen, "{unseen} of {seen}");
    }

    #[test]
    fn a_name_is_told_from_another_by_what_is_seen() {
        for good in [
            "Ada",
            "Ada L",
            "Ada-Łukasz",
            "עדה",
            "عدا",
            "艾达",
            "अदा",
            "O'Neil",
            "🦊",
            "a",
        ] {
            assert_eq!(check_name("/name", good, 64), Ok(()), "{good}");
        }
        for bad in [
            "",
            " ",
            "   ",
            "Ada ",
            " Ada",
            "Ada  L",
            "Ada\u{a0}L",
            "Ada\u{200b}",
            "\u{202e}adA",
            "Ada\u{2066}",
            "\u{3164}",
            "\u{2800}",
            "A\u{ad}da",
            "Ada\u{fe0f}",
            "Ada\n",
        ] {
            let refused = check_name("/name", bad, 64).unwrap_err();
            assert_eq!(refused.pointer, "/name", "{bad:?}");
        }
        // Of what is only read, blanks are the writer's own.
        assert_eq!(check_text("/reason", "Enough.  Stop. ", 64), Ok(()));
        assert!(check_text("/reason", "  ", 64).is_err());
        let refused = check_text("/reason", "e\u{202e}a", 64).unwrap_err();
        assert_eq!(
            refused.detail,
            "it has U+202E, which cannot be seen or moves what is around it"
        );
    }

    #[test]
    fn whatever_came_is_made_a_name() {
        for (came, name) in [
            ("Ada", "Ada"),
            ("", "somebody"),
            ("\u{200b}\u{3164} \n", "somebody"),
            ("\u{202e}Eve\u{202c}", "Eve"),
            ("E\u{ad}ve", "E ve"),
            ("  Ada \t L  ", "Ada L"),
            ("abcdefgh", "abcdef"),
            ("abcde fgh", "abcde"),
        ] {
            let made = fitted(came, 6, "somebody");
            assert_eq!(made, name, "{came:?}");
            assert_eq!(check_name("/name", &made, 8), Ok(()));
        }
    }
}
