//! Damaged case files: whatever happens to a file, reading it gives a case or an error that names the file.

use std::fs;
use std::path::{Path, PathBuf};

use cases::{Case, Look};

/// What is written over or between the good text: things that have a meaning somewhere.
const SCRAPS: [&str; 40] = [
    "\"",
    "'",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "=",
    ",",
    ".",
    "#",
    "\n",
    "\r\n",
    "\t",
    " ",
    "-",
    "0",
    "-1",
    "1e999",
    "nan",
    "inf",
    "true",
    "\"-1 mm\"",
    "\"2 V\"",
    "\"\"",
    "[]",
    "{}",
    "[[]]",
    "1979-05-27",
    "µ",
    "é",
    "🪤",
    "\u{0}",
    "\u{feff}",
    "name",
    "kind",
    "electrode",
    "[drive.main]\ndrive = \"main\"\n",
    "99999999999999999999",
];

/// Numbers that look random and are the same in every run (xorshift, Marsaglia 2003).
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end.max(1) as u64) as usize
    }
}

fn good_files() -> Vec<(PathBuf, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/cli/good");
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    files.into_iter().map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
}

fn mutated(text: &str, others: &[(PathBuf, String)], dice: &mut Dice) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..=dice.below(3) {
        let at = dice.below(lines.len());
        if lines.is_empty() {
            break;
        }
        match dice.below(12) {
            0 => drop(lines.remove(at)),
            1 => lines.insert(at, lines[at].clone()),
            2 => {
                let to = dice.below(lines.len());
                lines.swap(at, to);
            }
            3 => {
                let other: Vec<&str> = others[dice.below(others.len())].1.lines().collect();
                lines[at] = other[dice.below(other.len())].to_owned();
            }
            kind => {
                let mut letters: Vec<char> = lines[at].chars().collect();
                let letter = dice.below(letters.len());
                let scrap = SCRAPS[dice.below(SCRAPS.len())];
                match kind {
                    // A third of all damage is another digit, after which many files are still fine.
                    8.. => {
                        for letter in letters.iter_mut().filter(|letter| letter.is_ascii_digit()) {
                            *letter = char::from(b'0' + dice.below(10) as u8);
                        }
                    }
                    4 if !letters.is_empty() => drop(letters.remove(letter)),
                    5 if !letters.is_empty() => letters.insert(letter, letters[letter]),
                    6 => drop(letters.splice(letter..letter, scrap.chars())),
                    _ => {
                        let end = (letter + 1 + dice.below(6)).min(letters.len());
                        drop(letters.splice(letter..end.max(letter), scrap.chars()));
                    }
                }
                lines[at] = letters.into_iter().collect();
            }
        }
    }
    lines.join(if dice.below(10) == 0 { "\r\n" } else { "\n" })
}

/// A key path and a value that may or may not fit together.
fn argument(text: &str, dice: &mut Dice) -> String {
    const PATHS: [&str; 14] = [
        "electrode.ball.dc",
        "electrode.1.center.2",
        "electrode.left.rf.amplitude",
        "electrode.9.dc",
        "electrode",
        "grains.1",
        "grains.dust.place.radius",
        "drive.main",
        "field.accuracy",
        "table.min",
        "sweep.\"electrode.1.dc\"",
        "title",
        ".",
        "\"",
    ];
    let lines: Vec<&str> = text.lines().collect();
    let value = match dice.below(3) {
        0 => SCRAPS[dice.below(SCRAPS.len())],
        _ => lines[dice.below(lines.len())].split_once('=').map_or("1", |(_, value)| value),
    };
    format!("{}={value}", PATHS[dice.below(PATHS.len())])
}

/// About 2 s on one core.
#[test]
fn damaged_files_never_panic_and_errors_name_the_file() {
    let files = good_files();
    let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
    let (mut read, mut refused) = (0, 0);
    for n in 0..20_000 {
        let (path, text) = &files[n % files.len()];
        let text = mutated(text, &files, &mut dice);
        let sets = if dice.below(5) == 0 { vec![argument(&text, &mut dice)] } else { Vec::new() };
        match Case::parse(path.with_file_name("case.toml"), &text, &sets) {
            Ok((case, source)) => {
                serde_json::to_string(&case).unwrap();
                case.parts();
                source.error_at("electrode.ball.center", "touches", "move it").report(Look::PLAIN);
                read += 1;
            }
            Err(error) => {
                for message in [error.to_string(), error.report(Look::PLAIN), error.report(Look::TERMINAL)] {
                    assert!(message.contains("case.toml"), "no file in {message:?} of\n{text}");
                }
                let json = error.json();
                assert!(json["error"]["file"].as_str().unwrap().ends_with("case.toml"));
                assert!(!json["error"]["problem"].as_str().unwrap().is_empty(), "{text}");
                // A line there is, unless the error is about the whole file, or about the command line.
                let somewhere = error.line.is_some() || error.set.is_some() || error.key.is_none();
                assert!(somewhere, "no line in {error}");
                refused += 1;
            }
        }
    }
    assert!(read > 2000 && refused > 2000, "{read} read, {refused} refused: the damage should do both");
}

#[test]
fn deep_files_do_not_exhaust_the_stack() {
    const DEEP: usize = 100_000;
    let ball = "[[electrode]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 1\n";
    let dots = ".a".repeat(DEEP);
    for (text, set) in [
        (format!("a{dots} = 1\n{ball}"), None),
        (format!("{ball}[sweep]\na{dots} = [1]\n"), None),
        (format!("{ball}title = {}{}\n", "[".repeat(DEEP), "]".repeat(DEEP)), None),
        (format!("{ball}dc = {}1{}\n", "{ a = ".repeat(DEEP), "}".repeat(DEEP)), None),
        (ball.to_owned(), Some(format!("sweep{dots}=1"))),
        (ball.to_owned(), Some(format!("title={}", "[".repeat(DEEP)))),
        (ball.to_owned(), Some(format!("title={{a{dots} = 1}}"))),
    ] {
        let sets: Vec<String> = set.into_iter().collect();
        let error = Case::parse("case.toml", &text, &sets).unwrap_err();
        assert!(error.report(Look::PLAIN).contains("case.toml"));
    }
}
