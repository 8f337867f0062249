//! The program: the command line, with the window where the build has one.

fn main() {
    std::process::exit(relit::cli::run(None));
}
