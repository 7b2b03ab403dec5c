//! Events that wait for the next step.

use std::collections::{BTreeSet, VecDeque};

use dapple_scene::Edit;

use crate::Event;

/// Of each event that waits, whether a later one of its node makes it not matter.
pub(super) fn overtaken(queue: &VecDeque<(u64, u32, Event)>) -> Vec<bool> {
    let mut placed = BTreeSet::new();
    let mut overtaken: Vec<bool> = queue
        .iter()
        .rev()
        .map(|(_, _, event)| match event {
            Event::Edit { change: Edit::Place { node, .. } } => !placed.insert(*node),
            Event::Edit { change: Edit::Release { node } } => {
                placed.remove(node);
                false
            }
            // What they do depends on what was before.
            Event::Edit { change: Edit::Reset } | Event::Add { .. } => {
                placed.clear();
                false
            }
            _ => false,
        })
        .collect();
    overtaken.reverse();
    overtaken
}

#[cfg(test)]
mod tests {
    use super::*;
    use dapple_scene::Placement;

    #[test]
    fn of_many_places_of_a_node_the_last_counts() {
        let placement = Placement { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] };
        let edit = |change| Event::Edit { change };
        let place = |node| edit(Edit::Place { node, placement });
        let events = [
            place(1),
            place(2),
            place(1),
            edit(Edit::Release { node: 1 }),
            place(1),
            Event::Pause,
            place(1),
            edit(Edit::Reset),
            place(2),
            place(2),
        ];
        let queue: VecDeque<_> = (1..).zip(events).map(|(number, event)| (7, number, event)).collect();
        let expected = [true, false, false, false, true, false, false, false, true, false];
        assert_eq!(overtaken(&queue), expected);
    }
}
