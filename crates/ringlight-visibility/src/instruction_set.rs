//! Run-time choice of the instruction set. One source serves all; the bits are the same.

use pulp::Simd;

/// Vector instructions to use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// 16 lanes, masks in registers of their own.
    Avx512,
    /// 8 lanes.
    Avx2,
    /// 4 lanes in plain code, on any machine.
    Portable,
}

impl InstructionSet {
    /// The best one this machine has.
    pub fn best() -> InstructionSet {
        InstructionSet::available()[0]
    }

    /// Those this machine has, best first.
    pub fn available() -> Vec<InstructionSet> {
        let mut sets = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            if pulp::x86::V4::try_new().is_some() {
                sets.push(InstructionSet::Avx512);
            }
            if pulp::x86::V3::try_new().is_some() {
                sets.push(InstructionSet::Avx2);
            }
        }
        sets.push(InstructionSet::Portable);
        sets
    }

    /// Runs `task` compiled for this instruction set, or for the portable one if the machine lacks it.
    #[inline(always)]
    pub(crate) fn run<T: Task>(self, task: T) -> T::Output {
        #[cfg(target_arch = "x86_64")]
        match self {
            InstructionSet::Avx512 => {
                if let Some(machine) = pulp::x86::V4::try_new() {
                    return machine.vectorize(Bound { task, machine });
                }
            }
            InstructionSet::Avx2 => {
                if let Some(machine) = pulp::x86::V3::try_new() {
                    return machine.vectorize(Bound { task, machine });
                }
            }
            InstructionSet::Portable => {}
        }
        task.run(pulp::Scalar128b)
    }
}

/// What is compiled once per instruction set. `run` and all it calls in the inner loops must be `#[inline(always)]`, or
/// they would be compiled without the instructions.
pub(crate) trait Task {
    type Output;
    fn run<M: Machine>(self, machine: M) -> Self::Output;
}

/// Lanes, and what `pulp` leaves out: a mask as an integer.
pub(crate) trait Machine: Simd {
    /// Bit i is lane i.
    fn bits(self, mask: Self::m32s) -> u32;

    /// Runs `task`, as a function of its own.
    fn call<T: Task>(self, task: T) -> T::Output;
}

#[cfg(target_arch = "x86_64")]
impl Machine for pulp::x86::V4 {
    #[inline(always)]
    fn bits(self, mask: Self::m32s) -> u32 {
        u32::from(mask.0)
    }

    #[inline(always)]
    fn call<T: Task>(self, task: T) -> T::Output {
        self.vectorize(Bound { task, machine: self })
    }
}

#[cfg(target_arch = "x86_64")]
impl Machine for pulp::x86::V3 {
    #[inline(always)]
    fn bits(self, mask: Self::m32s) -> u32 {
        self.avx._mm256_movemask_ps(pulp::bytemuck::cast(mask)) as u32
    }

    #[inline(always)]
    fn call<T: Task>(self, task: T) -> T::Output {
        self.vectorize(Bound { task, machine: self })
    }
}

impl Machine for pulp::Scalar128b {
    #[inline(always)]
    fn bits(self, mask: Self::m32s) -> u32 {
        let lanes: [u32; 4] = pulp::bytemuck::cast(mask);
        (lanes[0] & 1) | (lanes[1] & 2) | (lanes[2] & 4) | (lanes[3] & 8)
    }

    fn call<T: Task>(self, task: T) -> T::Output {
        task.run(self)
    }
}

#[cfg(target_arch = "x86_64")]
struct Bound<T, M> {
    task: T,
    machine: M,
}

#[cfg(target_arch = "x86_64")]
impl<T: Task, M: Machine> pulp::NullaryFnOnce for Bound<T, M> {
    type Output = T::Output;

    #[inline(always)]
    fn call(self) -> T::Output {
        self.task.run(self.machine)
    }
}
