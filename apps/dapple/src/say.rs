//! Printing that does not mind a reader who has gone, as in `dapple scene | head`.

/// `println!`, but a closed standard output is no reason to panic.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}
