//! The lines of a text header that a binary body may follow, whatever ends them: LF, CR LF, CR, LF CR, or one after
//! the other.

/// The lines that end in `text`, whether with LF, CR LF or CR: for messages.
pub(super) fn lines_of(text: &[u8]) -> usize {
    let count = |end: u8| text.iter().filter(|byte| **byte == end).count();
    count(b'\n').max(count(b'\r'))
}

/// How a line ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LineEnd {
    Lf,
    CrLf,
    Cr,
    LfCr,
}

/// Walks over the lines of a header.
pub(super) struct HeaderLines<'a> {
    bytes: &'a [u8],
    /// A header that is longer (bytes) is none.
    most: usize,
    position: usize,
    number: usize,
    /// Where the end of the last line begins.
    last_end: usize,
    /// The ends of all lines before the last one, each kind once.
    ends: Vec<LineEnd>,
}

impl<'a> HeaderLines<'a> {
    /// The lines from byte `start` on.
    pub(super) fn new(bytes: &'a [u8], start: usize, most: usize) -> Self {
        HeaderLines { bytes, most, position: start, number: 0, last_end: start, ends: Vec::new() }
    }

    /// The next line and its number, counted from 1; `None` where no line ends any more.
    pub(super) fn next_line(&mut self) -> Option<(usize, &'a str)> {
        if self.number > 0 {
            let end = self.end_at(self.last_end);
            if !self.ends.contains(&end) {
                self.ends.push(end);
            }
        }
        let rest = self.bytes.get(self.position..self.bytes.len().min(self.most))?;
        let length = memchr::memchr2(b'\n', b'\r', rest)?;
        self.last_end = self.position + length;
        let end = self.end_at(self.last_end);
        self.position = self.last_end + if matches!(end, LineEnd::CrLf | LineEnd::LfCr) { 2 } else { 1 };
        self.number += 1;
        // a line that is no UTF-8 can only be a comment or stray
        Some((self.number, std::str::from_utf8(&rest[..length]).unwrap_or("").trim()))
    }

    /// Lines so far.
    pub(super) fn count(&self) -> usize {
        self.number
    }

    fn end_at(&self, place: usize) -> LineEnd {
        match self.bytes[place..] {
            [b'\r', b'\n', ..] => LineEnd::CrLf,
            [b'\r', ..] => LineEnd::Cr,
            // LF and then a blank line that ends with CR or CR LF, unless all lines end so
            [b'\n', b'\r', b'\n', ..] if self.ends.is_empty() => LineEnd::Lf,
            [b'\n', b'\r', ..] if self.ends.is_empty() || self.ends.contains(&LineEnd::LfCr) => LineEnd::LfCr,
            _ => LineEnd::Lf,
        }
    }

    /// Where the body begins after the last line, whose end may run into it: a body may begin with CR or LF. The other
    /// lines say how lines end; where they don't agree, `body_bytes`, the length of the body, decides if it is known.
    pub(super) fn body_start(&self, body_bytes: Option<u64>) -> usize {
        let (one, two) = (self.last_end + 1, self.last_end + 2);
        let has = |end| self.ends.contains(&end);
        match self.bytes[self.last_end..] {
            [b'\r', b'\n', ..] if has(LineEnd::CrLf) && !has(LineEnd::Cr) => two,
            [b'\r', b'\n', ..] if has(LineEnd::Cr) && !has(LineEnd::CrLf) => one,
            [b'\r', b'\n', ..] => {
                let fits = |start: usize| Some((self.bytes.len() - start) as u64) == body_bytes;
                if fits(one) { one } else { two }
            }
            [b'\n', b'\r', ..] if has(LineEnd::LfCr) => two,
            _ => one,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The lines of `text` up to `end`, and the body after it.
    fn read(text: &str, body_bytes: Option<u64>) -> (Vec<&str>, &str) {
        let mut lines = HeaderLines::new(text.as_bytes(), 0, usize::MAX);
        let mut found = Vec::new();
        while let Some((_, line)) = lines.next_line() {
            if line == "end" {
                return (found, &text[lines.body_start(body_bytes)..]);
            }
            found.push(line);
        }
        panic!("there is no end");
    }

    #[test]
    fn lines_of_every_end_are_parted_from_a_body_that_begins_like_one() {
        for end in ["\n", "\r\n", "\r", "\n\r"] {
            for body in ["\r1", "\n1", "\r\n1", "\n\r1", "1"] {
                // CR and then LF would be one end: what begins with LF is told by the other lines
                let text = format!("a{end}b{end}c{end}end{end}{body}");
                assert_eq!(read(&text, None), (vec!["a", "b", "c"], body), "{text:?}");
            }
        }
    }

    #[test]
    fn mixed_ends_are_read() {
        assert_eq!(read("a\r\nb\r\nend\nBODY", None), (vec!["a", "b"], "BODY"));
        assert_eq!(read("a\r\nb\nc\r\nend\r\nBODY", None), (vec!["a", "b", "c"], "BODY"));
        assert_eq!(read("a\nb\nend\r\nBODY", None), (vec!["a", "b"], "BODY"));
        assert_eq!(read("a\rb\r\nc\nend\r\nBODY", Some(4)), (vec!["a", "b", "c"], "BODY"));
        assert_eq!(read("a\rb\r\nc\nend\r\nBODY", Some(5)), (vec!["a", "b", "c"], "\nBODY"));
    }
}
