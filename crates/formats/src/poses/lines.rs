//! Lines of text files: words and numbers, whatever stands between them.

use std::borrow::Cow;

/// The lines that are neither empty nor comments, with their places.
pub(crate) fn data(text: &str) -> impl Iterator<Item = (usize, &str)> + Clone {
    let lines = text.lines().enumerate().map(|(index, line)| (index, line.trim()));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// The words of a line: between blanks, commas, semicolons and brackets. Where a comma stands for the decimal point, it
/// becomes one: `0,5; 1,0` and `0,5 1,0` are two numbers.
pub(crate) fn words(line: &str) -> Vec<Cow<'_, str>> {
    let is_between = |c: char| c.is_whitespace() || matches!(c, ';' | '[' | ']' | '(' | ')');
    if !has_decimal_commas(line) {
        return line.split(|c| is_between(c) || c == ',').filter(|word| !word.is_empty()).map(Cow::from).collect();
    }
    line.split(is_between).filter(|word| !word.is_empty()).map(|word| Cow::from(word.replace(',', "."))).collect()
}

/// Whether commas are decimal points: numbers are separated otherwise, and no word has a comma at its end or several.
fn has_decimal_commas(line: &str) -> bool {
    if !line.contains(',') {
        return false;
    }
    let words = || line.split(|c: char| c.is_whitespace() || c == ';').filter(|word| !word.is_empty());
    let is_one = |word: &str| match word.split_once(',') {
        None => true,
        Some((before, after)) => {
            let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
            digits(before.trim_start_matches(['-', '+'])) && after.starts_with(|c: char| c.is_ascii_digit()) && {
                let exponent = after.trim_start_matches(|c: char| c.is_ascii_digit());
                exponent.is_empty() || exponent.starts_with(['e', 'E'])
            }
        }
    };
    words().count() > 1 && words().all(is_one)
}

/// The numbers of a line, if all of its words are numbers and there are `N`.
pub(crate) fn numbers<const N: usize>(line: &str) -> Option<[f64; N]> {
    numbers_of(&words(line))
}

/// The same of words.
pub(crate) fn numbers_of<const N: usize>(words: &[Cow<'_, str>]) -> Option<[f64; N]> {
    if words.len() != N {
        return None;
    }
    let mut numbers = [0.0; N];
    for (slot, word) in numbers.iter_mut().zip(words) {
        *slot = word.parse().ok()?;
    }
    Some(numbers)
}

/// How many numbers a line holds, if it holds nothing else.
pub(crate) fn count_numbers(line: &str) -> Option<usize> {
    let words = words(line);
    words.iter().all(|word| is_number(word)).then_some(words.len())
}

pub(crate) fn is_number(word: &str) -> bool {
    word.parse::<f64>().is_ok()
}

/// Whether a word is a whole number that is not negative.
pub(crate) fn is_index(word: &str) -> bool {
    !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_whatever_stands_between_them() {
        for line in ["1 -0.5 2e3", "1,-0.5,2e3", "1, -0.5, 2e3", "[[1.; -.5; 2000]]", "\t1\t-0.5\t2e3", "1;-0,5;2e3"] {
            assert_eq!(numbers::<3>(line), Some([1.0, -0.5, 2000.0]), "{line}");
        }
        assert_eq!(numbers::<2>("0,5 1,25e2"), Some([0.5, 125.0]), "a comma as decimal point");
        assert_eq!(numbers::<4>("1.5,2 3,4"), Some([1.5, 2.0, 3.0, 4.0]), "a comma between numbers");
        assert_eq!(numbers::<2>("1 x"), None);
        assert_eq!(numbers::<2>("1 2 3"), None);
        assert_eq!(count_numbers("1 2 3"), Some(3));
        assert_eq!(count_numbers("a 2 3"), None);
    }

    #[test]
    fn comments_and_empty_lines_are_no_data() {
        assert_eq!(data("# a\n\n b \r\n").collect::<Vec<_>>(), [(2, "b")]);
    }
}
