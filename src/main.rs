//! The `bondspice` command.

fn main() -> std::process::ExitCode {
    bondspice::cli::main()
}
