#pragma once
// The stopwatch of the benchmark, and its scale for memory: the same for our program and for the peers, hence it knows nothing of Cardan.
#include <malloc.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <vector>

namespace cardan::bench {

struct Timing {
  double min_ns, median_ns;  // per call, over the samples
};

/// The program, and what it starts, stays on the core that it is on.
inline void stay_on_this_core() {
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(sched_getcpu(), &one);
  sched_setaffinity(0, sizeof one, &one);
}

/// Time of call(k), k over a ring of states. A sample is the mean over passes of the ring, at least 0.2 ms; samples are
/// taken for `seconds`, at least five. Where one pass alone takes longer than that, a sample is one call, at least three.
template <class Call>
Timing time_ring(int states, double seconds, const Call& call) {
  using Clock = std::chrono::steady_clock;
  const auto since = [](Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); };
  call(0);
  auto begin = Clock::now();
  call(1 % states);
  const double once = std::max(1e-9, since(begin));
  const bool slow = once * states > std::max(seconds, 0.01);
  for (int k = 0; !slow && k < states; ++k) call(k);  // warm-up
  const int calls = slow ? 1 : states * std::max(1, static_cast<int>(2e-4 / (once * states)));
  const std::size_t least = slow ? 3 : 5;
  std::vector<double> samples;
  const auto start = Clock::now();
  int k = 2 % states;  // never the state just computed: a program may remember it
  do {
    begin = Clock::now();
    for (int i = 0; i < calls; ++i) {
      call(k);
      if (++k == states) k = 0;
    }
    samples.push_back(1e9 * since(begin) / calls);
  } while (samples.size() < least || since(start) < seconds);
  std::sort(samples.begin(), samples.end());
  return {samples.front(), samples[samples.size() / 2]};
}

/// What the heap holds, in bytes: the difference around model and first call is what a program needs for them.
inline double heap_bytes() {
  const auto info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);
}

}  // namespace cardan::bench
