//! Random columns of the provider `layers`: `cargo run --release -p sunglint-atmosphere --example sweep -- 100000 [first seed]`
//! prints what is wrong with any of their answers, with the seed, and ends with 1 where anything is.

#[path = "../tests/sweep/mod.rs"]
mod sweep;

use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse::<u64>());
    let (Ok(count), Ok(first)) = (arguments.next().unwrap_or(Ok(1000)), arguments.next().unwrap_or(Ok(0))) else {
        eprintln!("sweep [number of columns] [first seed]");
        return ExitCode::from(2);
    };
    let (done, wrong) = (AtomicU64::new(0), AtomicU64::new(0));
    (first..first + count).into_par_iter().for_each(|seed| {
        let found = sweep::violations(seed);
        if !found.is_empty() {
            wrong.fetch_add(1, Ordering::Relaxed);
            let (file, _) = sweep::file(&mut sweep::Random::new(seed));
            println!("seed {seed}\n  {}\n{file}", found.join("\n  "));
        }
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        if done.is_multiple_of(1000) {
            eprintln!("{done} columns");
        }
    });
    let wrong = wrong.into_inner();
    println!("{count} columns, {wrong} with faults");
    if wrong == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
