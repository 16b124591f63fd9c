#include "core/abi/trial.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace cardan {
namespace {

enum class Progress : int { running, returned, threw, called_exit };

/// Written by the child, read by the parent.
struct Shared {
  volatile Progress progress;
  char phase[500];
};
Shared* shared_with_parent = nullptr;  // in the child

[[noreturn]] void run_child(const std::function<void(const TellPhase&)>& work, TrialLimits limits) {
  for (const int s : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGALRM, SIGPIPE, SIGINT, SIGTERM})
    signal(s, SIG_DFL);
  const rlimit no_core{0, 0}, cpu{limits.cpu_s, limits.cpu_s + 1};
  setrlimit(RLIMIT_CORE, &no_core);
  setrlimit(RLIMIT_CPU, &cpu);
  const int nowhere = open("/dev/null", O_RDWR);
  for (const int output : {STDOUT_FILENO, STDERR_FILENO})
    if (nowhere >= 0) dup2(nowhere, output);
  std::atexit([] {  // registered last, called first: nothing of the parent's is flushed or closed a second time
    shared_with_parent->progress = Progress::called_exit;
    _exit(0);
  });
  try {
    work([](std::string_view phase) {
      char* text = shared_with_parent->phase;
      const std::size_t n = std::min(phase.size(), sizeof shared_with_parent->phase - 1);
      std::memcpy(text, phase.data(), n);
      text[n] = '\0';
    });
    shared_with_parent->progress = Progress::returned;
  } catch (const std::exception&) {
    shared_with_parent->progress = Progress::returned;
  } catch (...) {
    shared_with_parent->progress = Progress::threw;
  }
  _exit(0);
}

/// The status of the child once it has ended; empty if it had to be killed.
std::optional<int> wait_for(pid_t child, double seconds) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  timespec pause{0, 50'000};
  for (int status = 0;;) {
    if (waitpid(child, &status, WNOHANG) == child) return status;
    if (Clock::now() >= end) {
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      return {};
    }
    nanosleep(&pause, nullptr);
    pause.tv_nsec = std::min(2 * pause.tv_nsec, 5'000'000L);
  }
}

std::string story(const std::optional<int>& status, Progress progress, TrialLimits limits) {
  if (!status) return fmt::format("no answer within {:g} s", limits.wall_s);
  if (WIFSIGNALED(*status)) {
    const int s = WTERMSIG(*status);
    return s == SIGXCPU || s == SIGKILL ? fmt::format("no end within {} s of computing", limits.cpu_s) : strsignal(s);
  }
  if (progress == Progress::threw) return "an exception that is no std::exception";
  return progress == Progress::returned ? "" : "the process was ended (exit)";
}

}  // namespace

std::optional<std::string> end_in_child(const std::function<void(const TellPhase&)>& work, TrialLimits limits) {
  void* memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return {};
  auto* shared = new (memory) Shared{};
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    shared_with_parent = shared;
    run_child(work, limits);
  }
  std::string end;
  if (child > 0) {
    const std::optional<int> status = wait_for(child, limits.wall_s);
    end = story(status, shared->progress, limits);
    if (!end.empty() && shared->phase[0] != '\0') end += fmt::format(", in {}", shared->phase);
  }
  munmap(memory, sizeof(Shared));
  return end.empty() ? std::nullopt : std::optional(end);
}

}  // namespace cardan
