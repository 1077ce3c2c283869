//! The command `graintrap`.

fn main() -> std::process::ExitCode {
    cases::cli::main()
}
