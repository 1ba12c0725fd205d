//! Questions over a ring: tasks that ask are suspended until their answers have come home, and many are under way at once.

use super::Ring;
use super::exchange::Part;
use crate::mesh::walk::{self, Query, Rule};
use crate::mesh::{Answer, Inquiry, Mailbox, Mesh, Question, at_once};
use crate::ring::{Aimed, Answers, Content, Packet, Rays, Samples};
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;
use ringlight_visibility::{Cells, Hierarchy, NO_PLANE, Points, Ray, Shooter, searched};
use std::collections::{BTreeMap, VecDeque};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, Waker};

/// Tasks that are run together where all triangles are held, for each thread.
const TOGETHER: usize = 64;

/// A suspended task and where it leaves its questions.
struct Task<F> {
    future: Pin<Box<F>>,
    mailbox: Arc<Mailbox>,
}

/// A rank's part in what its tasks ask: their questions in packets, and what they come to given to `end`.
struct Asking<Tasks, F, End> {
    /// Those that have not begun.
    tasks: Tasks,
    end: End,
    /// Those whose questions are under way, by ticket.
    under_way: BTreeMap<u32, Task<F>>,
    /// Those whose answers have come home.
    home: VecDeque<Task<F>>,
    /// Questions that have not set off.
    ready: VecDeque<Packet>,
    tickets: u32,
}

/// Finds what a shard has in the way of rays; counts what it looks at, see [`searched`].
pub fn test(mesh: &Mesh, shard: &Hierarchy, rays: &mut Rays) -> u64 {
    let query = |(&ray, &rule): (&Ray, &[u32; 2])| Query { ray, rule: Rule::from_words(rule) };
    let nearest_hits = |rays: &[Ray], rules: &[[u32; 2]]| match rules.iter().all(|&rule| rule == Rule::All.to_words()) {
        true => shard.nearest_hits(rays),
        false => walk::nearest_hits(mesh, shard, &rays.iter().zip(rules).map(query).collect::<Vec<_>>()),
    };
    searched(|| rays.test(nearest_hits)).1
}

impl<'a> Ring<'a> {
    /// Runs a task of this rank for each of `inputs`, and helps others with what theirs ask. `end` is given what the tasks
    /// come to, in any order. Every rank of the ring calls it, also those without inputs.
    pub fn ask<I, F>(
        &mut self,
        ranks: &mut Communicator<'_>,
        mut inputs: impl Iterator<Item = I>,
        task: impl Fn(I, Inquiry<'a>) -> F,
        mut end: impl FnMut(F::Output),
    ) -> Result<(), Failure>
    where
        F: Future<Output: Send> + Send,
    {
        if self.holds_all() {
            let inquiry = Inquiry::Here(self.mesh(), self.hierarchy().clone());
            loop {
                let some = inputs.by_ref().take(TOGETHER * rayon::current_num_threads());
                let some: Vec<F> = some.map(|input| task(input, inquiry.clone())).collect();
                if some.is_empty() {
                    return Ok(());
                }
                let ended: Vec<_> = some.into_par_iter().map(|task| searched(|| at_once(task))).collect();
                for (output, looked_at) in ended {
                    self.count_search(looked_at);
                    end(output);
                }
            }
        }
        let most = self.packet_size();
        let tasks = inputs.map(|input| {
            let mailbox = Arc::new(Mailbox::new(most));
            Task { future: Box::pin(task(input, Inquiry::Away(mailbox.clone()))), mailbox }
        });
        let (under_way, home, ready) = (BTreeMap::new(), VecDeque::new(), VecDeque::new());
        self.serve_to_the_end(ranks, &mut Asking { tasks, end, under_way, home, ready, tickets: 0 })
    }
}

impl<Tasks, F, End> Asking<Tasks, F, End>
where
    Tasks: Iterator<Item = Task<F>>,
    F: Future<Output: Send> + Send,
    End: FnMut(F::Output),
{
    /// Lets tasks go on, one for each thread: those whose answers are there, else new ones. False if there are none.
    fn go_on(&mut self) -> bool {
        let most = rayon::current_num_threads();
        let mut some: Vec<Task<F>> = self.home.drain(..most.min(self.home.len())).collect();
        some.extend(self.tasks.by_ref().take(most - some.len()));
        let go_on = |task: &mut Task<F>| task.future.as_mut().poll(&mut Context::from_waker(Waker::noop()));
        let polled: Vec<Poll<F::Output>> = match some.as_mut_slice() {
            [] => return false,
            [task] => vec![go_on(task)],
            several => several.par_iter_mut().map(go_on).collect(),
        };
        for (task, polled) in some.into_iter().zip(polled) {
            match polled {
                Poll::Ready(output) => (self.end)(output),
                Poll::Pending => {
                    let question = task.mailbox.question().expect("a task is suspended only because it asks");
                    self.tickets += 1;
                    let packet = Packet { ticket: self.tickets, content: content(question), ..Packet::default() };
                    self.ready.push_back(packet);
                    self.under_way.insert(self.tickets, task);
                }
            }
        }
        true
    }
}

impl<Tasks, F, End> Part for Asking<Tasks, F, End>
where
    Tasks: Iterator<Item = Task<F>>,
    F: Future<Output: Send> + Send,
    End: FnMut(F::Output),
{
    fn next(&mut self) -> Option<Packet> {
        while self.ready.is_empty() && self.go_on() {}
        self.ready.pop_front()
    }

    fn finish(&mut self, ticket: u32, answers: Answers) {
        let task = self.under_way.remove(&ticket).expect("own packets belong to own tasks");
        task.mailbox.answer(match answers {
            Answers::Hits(hits) => Answer::Hits(hits),
            Answers::Masks(masks) => Answer::Masks(masks),
        });
        self.home.push_back(task);
    }
}

/// A question as it travels.
fn content(question: Question) -> Content {
    match question {
        Question::Hits(queries) => {
            let mut rays = Rays::with_capacity(queries.len());
            queries.iter().for_each(|query| rays.push(query.ray, query.rule.to_words()));
            Content::Rays(rays)
        }
        Question::Masks(shooter, [x, y, z], plane, masks) => {
            let points = Points { x: &x, y: &y, z: &z, plane: &plane };
            Content::Aimed(Aimed::new(shooter, Samples::of(&[(points, &masks)])))
        }
    }
}

/// The shooter of a job whose questions bring their own, or none.
pub fn nothing() -> Shooter {
    Shooter { cells: Cells::Points(Vec::new()), plane: NO_PLANE, far: 1.0 }
}
