//! Edges by what they cost. Costs that differ by less than a hundredth are one: what comes of a surface does not depend on their
//! order, and no heap has to be kept in order, which took half of the time.

/// Bits of a cost that are kept: its exponent and so many of its fraction make 64 steps to a factor of two.
const DROPPED_BITS: u32 = 17;

/// Values by cost, least first.
#[derive(Debug, Clone)]
pub(super) struct Queue<T> {
    steps: Vec<Vec<T>>,
    /// No step before this one holds anything.
    least: usize,
}

impl<T> Queue<T> {
    pub(super) fn new() -> Queue<T> {
        Queue { steps: (0..=Self::step(f32::MAX)).map(|_| Vec::new()).collect(), least: 0 }
    }

    /// The costs that are one; the bits of numbers from 0 are in the order of the numbers.
    fn step(cost: f32) -> usize {
        (if cost > 0.0 { cost.min(f32::MAX) } else { 0.0 }.to_bits() >> DROPPED_BITS) as usize
    }

    pub(super) fn push(&mut self, cost: f32, value: T) {
        let step = Self::step(cost);
        self.steps[step].push(value);
        self.least = self.least.min(step);
    }

    /// One of those that cost least; the last that came of them.
    pub(super) fn pop(&mut self) -> Option<T> {
        while let Some(step) = self.steps.get_mut(self.least) {
            if let Some(value) = step.pop() {
                return Some(value);
            }
            // a step is rarely filled again
            *step = Vec::new();
            self.least += 1;
        }
        self.least = 0;
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_costs_less_comes_first() {
        let mut queue = Queue::new();
        for cost in [3.0, 0.0, 1e-30, f32::INFINITY, 2.0] {
            queue.push(cost, cost);
        }
        assert_eq!([queue.pop(), queue.pop(), queue.pop()], [Some(0.0), Some(1e-30), Some(2.0)]);
        // cheaper ones that come later overtake
        queue.push(1.0, 1.0);
        assert_eq!(
            [queue.pop(), queue.pop(), queue.pop(), queue.pop()],
            [Some(1.0), Some(3.0), Some(f32::INFINITY), None]
        );
        queue.push(f32::NAN, 7.0);
        assert_eq!([queue.pop(), queue.pop()], [Some(7.0), None]);
    }
}
