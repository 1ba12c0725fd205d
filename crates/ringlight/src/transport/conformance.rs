//! What every transport must pass: one suite, run on every rank of a world.
//!
//! Each transport's tests start worlds of several sizes and call [`check`] on all ranks. Nothing is asserted where a
//! failing assertion would leave other ranks waiting.

use super::{Communicator, Failure, Message};
use std::cell::Cell;
use std::time::Duration;

/// What every rank does in one run.
type Case = fn(&mut Communicator<'_>) -> Result<(), Failure>;

/// Runs the suite; an error on every rank if anything is wrong on any.
pub fn check(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let cases: [Case; 13] = [
        all_send_before_any_receives,
        order_is_kept_across_tags,
        a_token_goes_round,
        ranks_without_work_end_early,
        a_large_message_arrives_whole,
        values_are_reduced,
        every_root_broadcasts,
        every_root_gathers,
        every_rank_gives_every_other_its_part,
        collectives_pass_by_other_messages,
        what_is_taken_in_while_serving_is_not_waited_for,
        traffic_is_counted,
        waiting_is_timed,
    ];
    for case in cases {
        ranks.run(case)?;
    }
    let mut wrong = Vec::new();
    for failing in 0..ranks.size() {
        check_failure(ranks, &[failing], false, &mut wrong);
        check_failure(ranks, &[failing], true, &mut wrong);
    }
    check_failure(ranks, &(0..ranks.size()).collect::<Vec<_>>(), false, &mut wrong);
    check_lonely_wait(ranks, &mut wrong);
    // The world is as good as new.
    ranks.run(a_token_goes_round)?;
    ranks.run(|ranks| {
        let message = wrong.join("; ");
        if wrong.is_empty() { Ok(()) } else { Err(Failure { rank: ranks.rank(), message }) }
    })
}

/// Content that differs for every sender, receiver and number.
fn content(from: usize, to: usize, number: usize, len: usize) -> Vec<u8> {
    (0..len).map(|i| (from * 31 + to * 17 + number * 7 + i % 251) as u8).collect()
}

/// A failed expectation as a failure.
fn expect(ranks: &Communicator<'_>, holds: bool, what: impl FnOnce() -> String) -> Result<(), Failure> {
    if holds { Ok(()) } else { Err(Failure { rank: ranks.rank(), message: what() }) }
}

/// More than any transport holds back on its own, empty messages among them.
fn all_send_before_any_receives(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    const LENGTHS: [usize; 6] = [0, 1, 100_000, 0, 3_000_000, 7];
    let (this, size) = (ranks.rank(), ranks.size());
    for (number, &len) in LENGTHS.iter().enumerate() {
        for to in 0..size {
            ranks.send(to, 5, content(this, to, number, len));
        }
    }
    let mut next = vec![0; size];
    for _ in 0..size * LENGTHS.len() {
        let Message { from, tag, bytes } = ranks.wait()?;
        let number = next[from];
        next[from] += 1;
        let expected = content(from, this, number, LENGTHS[number]);
        expect(ranks, tag == 5 && bytes == expected, || format!("message {number} from rank {from} is not as sent"))?;
    }
    let rest = ranks.receive()?;
    expect(ranks, rest.is_none(), || "there are more messages than were sent".into())
}

/// Small and large messages with different tags do not overtake each other.
fn order_is_kept_across_tags(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let (this, size) = (ranks.rank(), ranks.size());
    let len = |number: usize| if number.is_multiple_of(7) { 200_000 } else { number };
    for number in 0..50 {
        ranks.send((this + 1) % size, number as u32 % 3, content(this, 0, number, len(number)));
    }
    let before = (this + size - 1) % size;
    for number in 0..50 {
        let message = ranks.wait()?;
        let expected = Message { from: before, tag: number as u32 % 3, bytes: content(before, 0, number, len(number)) };
        expect(ranks, message == expected, || format!("message {number} from rank {before} is not in its place"))?;
    }
    Ok(())
}

/// Thrice round the ring of all ranks, which may be a ring of one.
fn a_token_goes_round(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let (this, size) = (ranks.rank(), ranks.size());
    let next = (this + 1) % size;
    if this == 0 {
        ranks.send(next, 1, vec![0]);
    }
    for turn in 1..=3u8 {
        let bytes = ranks.wait_for((this + size - 1) % size, 1)?;
        let expected = if this == 0 { turn } else { turn - 1 };
        let count = bytes.first().copied().unwrap_or(u8::MAX) + u8::from(this == 0);
        expect(ranks, count == expected, || format!("turn {turn}: the token says {count}"))?;
        if this != 0 || turn < 3 {
            ranks.send(next, 1, vec![count]);
        }
    }
    Ok(())
}

/// Only the first and the last rank speak, and late; the others have long returned.
fn ranks_without_work_end_early(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let last = ranks.size() - 1;
    if ranks.rank() == last {
        std::thread::sleep(Duration::from_millis(20));
        ranks.send(0, 2, vec![9]);
    }
    if ranks.rank() == 0 {
        let bytes = ranks.wait_for(last, 2)?;
        expect(ranks, bytes == [9], || format!("received {bytes:?}"))?;
    }
    Ok(())
}

fn a_large_message_arrives_whole(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    const LEN: usize = 64 << 20;
    let last = ranks.size() - 1;
    if ranks.rank() == 0 {
        ranks.send(last, 3, content(0, last, 1, LEN));
        ranks.send(last, 3, vec![4]);
    }
    if ranks.rank() == last {
        let (large, small) = (ranks.wait_for(0, 3)?, ranks.wait_for(0, 3)?);
        expect(ranks, large == content(0, last, 1, LEN) && small == [4], || "64 MiB are not as sent".into())?;
    }
    Ok(())
}

/// Many in a row, some ranks later than others.
fn values_are_reduced(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let (this, size) = (ranks.rank() as u64, ranks.size() as u64);
    for round in 0..100u64 {
        if (round + this).is_multiple_of(23) {
            std::thread::sleep(Duration::from_micros(300));
        }
        let add = |a: [u8; 8], b: [u8; 8]| (u64::from_le_bytes(a).wrapping_add(u64::from_le_bytes(b))).to_le_bytes();
        let sum = u64::from_le_bytes(ranks.all_reduce(4, (this * this + round).to_le_bytes(), add)?);
        let expected = (0..size).map(|rank| rank * rank + round).sum::<u64>();
        expect(ranks, sum == expected, || format!("round {round}: the sum is {sum}, expected {expected}"))?;
        let best = ranks.all_reduce(4, [(this * 7 + round) as u8 % 31], |a, b| a.max(b))?[0];
        let expected = (0..size).map(|rank| (rank * 7 + round) as u8 % 31).max().unwrap_or(0);
        expect(ranks, best == expected, || format!("round {round}: the greatest is {best}, expected {expected}"))?;
    }
    Ok(())
}

fn every_root_broadcasts(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    for root in (0..ranks.size()).chain(0..ranks.size()) {
        let own = if ranks.rank() == root { content(root, 0, 0, 1000 * root) } else { vec![1, 2, 3] };
        let bytes = ranks.broadcast(root, 6, own)?;
        expect(ranks, bytes == content(root, 0, 0, 1000 * root), || format!("not what rank {root} said"))?;
    }
    Ok(())
}

/// Parts of different lengths, none at all among them, at one rank and at all.
fn every_root_gathers(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let (this, size) = (ranks.rank(), ranks.size());
    let part = |rank: usize, round: usize| content(rank, 0, round, 5000 * ((rank + round) % 3));
    for round in 0..2 * size {
        let expected: Vec<Vec<u8>> = (0..size).map(|rank| part(rank, round)).collect();
        let root = round % size;
        let gathered = ranks.gather(root, 13, part(this, round))?;
        let fits = if this == root { gathered.as_ref() == Some(&expected) } else { gathered.is_none() };
        expect(ranks, fits, || format!("round {round}: rank {root} has not gathered what all gave"))?;
        let gathered = ranks.all_gather(13, part(this, round))?;
        expect(ranks, gathered == expected, || format!("round {round}: not all have what all gave"))?;
    }
    Ok(())
}

/// Parts of different lengths, none at all among them; ranks may be one exchange ahead of others.
fn every_rank_gives_every_other_its_part(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let (this, size) = (ranks.rank(), ranks.size());
    let part = |from: usize, to: usize, round: usize| content(from, to, round, 3000 * ((from + 2 * to + round) % 3));
    for round in 0..4 {
        let given = ranks.exchange(14, (0..size).map(|to| part(this, to, round)).collect())?;
        let fits = given.iter().enumerate().all(|(from, bytes)| *bytes == part(from, this, round));
        expect(ranks, given.len() == size && fits, || format!("round {round}: not what the others gave"))?;
    }
    Ok(())
}

/// Messages that are under way during a collective operation stay for later, in order.
fn collectives_pass_by_other_messages(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let (this, size) = (ranks.rank(), ranks.size());
    for number in 0..5 {
        (0..size).for_each(|to| ranks.send(to, 7, vec![number]));
        let sum = ranks.all_reduce(8, [1], |a, b| [a[0] + b[0]])?;
        expect(ranks, usize::from(sum[0]) == size, || format!("counted {} ranks", sum[0]))?;
    }
    for from in (0..size).rev() {
        for number in 0..5 {
            let bytes = ranks.wait_for(from, 7)?;
            expect(ranks, bytes == [number], || format!("rank {this} got {bytes:?} as number {number}"))?;
        }
    }
    Ok(())
}

/// Other work takes in all that has arrived, also what the collective operation waits for.
fn what_is_taken_in_while_serving_is_not_waited_for(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let mut serve = |ranks: &mut Communicator<'_>| {
        std::thread::sleep(Duration::from_millis(3));
        ranks.receive_where(|_| false).map(|message| message.is_some())
    };
    for round in 0..5 {
        ranks.all_reduce_meanwhile(15, [round], |a, b| a.max(b), &mut serve)?;
        ranks.broadcast_meanwhile(0, 15, vec![round], &mut serve)?;
    }
    Ok(())
}

fn traffic_is_counted(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let (this, size) = (ranks.rank(), ranks.size());
    (0..size).for_each(|to| ranks.send(to, 9, vec![0; 10 + to]));
    for from in 0..size {
        ranks.wait_for(from, 9)?;
    }
    let counted = ranks.traffic().get(&9).copied().unwrap_or_default();
    let bytes: usize = (0..size).filter(|&to| to != this).map(|to| 10 + to).sum();
    let fits = counted.messages == size as u64 - 1 && counted.bytes == bytes as u64;
    expect(ranks, fits, || format!("{counted:?} for {} messages with {bytes} bytes", size - 1))
}

/// By a clock that ticks when it is looked at: once before and once after each wait.
fn waiting_is_timed(ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let ticks = Cell::new(0.0);
    let clock = move || ticks.replace(ticks.get() + 1.0);
    let before = ranks.waited_seconds();
    ranks.time_waits(Box::new(clock));
    ranks.all_reduce(14, [0], |a, _| a)?;
    let waits = ranks.waited_seconds() - before;
    // How often a rank waits for others, and for how many messages of others, is theirs to decide; one that is alone never does.
    let fits = waits.fract() == 0.0 && waits >= 0.0 && (waits == 0.0 || ranks.size() > 1);
    expect(ranks, fits, || format!("waited {waits} times"))
}

/// Ranks fail, by an error or by a panic, while the others wait for a message that never comes.
fn check_failure(ranks: &mut Communicator<'_>, failing: &[usize], panics: bool, wrong: &mut Vec<String>) {
    let this = ranks.rank();
    let says = |rank: usize| format!("rank {rank} gives up");
    let result: Result<(), Failure> = ranks.run(|ranks| {
        ranks.send((this + 1) % ranks.size(), 11, vec![0; 100_000]);
        if failing.contains(&this) {
            if panics {
                std::panic::resume_unwind(Box::new(says(this)));
            }
            return Err(Failure { rank: this, message: says(this) });
        }
        ranks.wait_for(failing[0], 12).map(|_| ())
    });
    let ended_by = if failing.contains(&this) { this } else { failing[0] };
    let message = if panics { format!("panicked: {}", says(ended_by)) } else { says(ended_by) };
    let failed_here = ranks.failed_here();
    if result != Err(Failure { rank: ended_by, message }) || failed_here != failing.contains(&this) {
        wrong.push(format!("rank {this}, with {failing:?} failing (panics: {panics}): {result:?}, {failed_here}"));
    }
}

/// A rank that waits for a message that nobody can send any more ends with an error.
fn check_lonely_wait(ranks: &mut Communicator<'_>, wrong: &mut Vec<String>) {
    let result = ranks.run(|ranks| if ranks.rank() == 0 { ranks.wait().map(|_| ()) } else { Ok(()) });
    if !result.is_err_and(|failure| failure.rank == 0) {
        wrong.push(format!("rank {}: a wait for nobody did not fail", ranks.rank()));
    }
}
