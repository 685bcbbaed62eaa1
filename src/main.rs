//! The `bondspice` command.

// Decks of a million lines are a million small pieces; and a run should not depend on the platform's allocator.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    bondspice::cli::main()
}
