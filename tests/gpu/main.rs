//! The path tracer in WGSL on any adapter, a software one too. Skipped where there is none, unless one is demanded.

#[path = "../scenes/mod.rs"]
mod scenes;

mod failures;
mod furnace;
mod insertion;
mod pictures;
mod traversal;

use relit::gpu::{Adapters, Card};
use std::sync::OnceLock;

/// The adapter that all tests share; says so where there is none.
fn card() -> Option<&'static Card> {
    static CARD: OnceLock<Option<Card>> = OnceLock::new();
    let card = CARD.get_or_init(|| Card::open(Adapters::Any)).as_ref();
    if card.is_none() {
        let demanded = std::env::var_os("RELIT_REQUIRE_ADAPTER").is_some_and(|value| value == "1");
        assert!(!demanded, "no graphics adapter, but one is demanded");
        println!("skipped: no graphics adapter");
    }
    card
}
