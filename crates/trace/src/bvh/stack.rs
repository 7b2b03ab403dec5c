//! What is still to be visited.

/// A stack that lives in the caller's frame unless a tree is degenerate.
pub(crate) struct Stack<T, const INLINE: usize> {
    inline: [T; INLINE],
    len: usize,
    spilled: Vec<T>,
}

impl<T: Copy + Default, const INLINE: usize> Stack<T, INLINE> {
    #[inline(always)]
    pub(crate) fn new(root: T) -> Stack<T, INLINE> {
        let mut inline = [T::default(); INLINE];
        inline[0] = root;
        Stack { inline, len: 1, spilled: Vec::new() }
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, item: T) {
        if self.len < INLINE {
            self.inline[self.len] = item;
            self.len += 1;
        } else {
            self.spilled.push(item);
        }
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        if self.len == INLINE
            && let Some(item) = self.spilled.pop()
        {
            return Some(item);
        }
        if self.len == 0 {
            return None;
        }
        self.len -= 1;
        Some(self.inline[self.len])
    }
}
