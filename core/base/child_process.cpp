#include "core/base/child_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>

namespace cardan {
namespace {

using Clock = std::chrono::steady_clock;

/// No process may raise the greatest value again.
void limit(__rlimit_resource resource, double value, double greatest) {
  rlimit limits{};
  getrlimit(resource, &limits);  // RLIM_INFINITY is the greatest number
  limits.rlim_max = std::min(limits.rlim_max, static_cast<rlim_t>(greatest));
  limits.rlim_cur = std::min(limits.rlim_max, static_cast<rlim_t>(value));
  setrlimit(resource, &limits);
}

/// [bytes] of addresses in use.
[[maybe_unused]] double address_space() {
  double pages = 0.0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%lf", &pages) != 1) pages = 0.0;
    std::fclose(file);
  }
  return pages * static_cast<double>(sysconf(_SC_PAGESIZE));
}

void write_all(int pipe, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(pipe, bytes.data(), bytes.size());
    if (n < 0 && errno != EINTR) _exit(1);
    if (n > 0) bytes.remove_prefix(static_cast<std::size_t>(n));
  }
}

[[noreturn]] void child(int pipe, const std::function<void(const Say&)>& work, const ChildLimits& limits) {
  for (const int s : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGALRM, SIGPIPE, SIGINT, SIGTERM}) ::signal(s, SIG_DFL);
  const double cpu_s = std::ceil(limits.cpu_s);
  limit(RLIMIT_CORE, 0.0, 0.0);
  limit(RLIMIT_CPU, cpu_s, cpu_s + 1.0);  // SIGXCPU, and SIGKILL for who ignores it
#ifndef CARDAN_ADDRESS_CHECKS
  const double memory = address_space() + static_cast<double>(limits.memory);
  limit(RLIMIT_AS, memory, memory);
  const int nowhere = ::open("/dev/null", O_RDWR);  // what a dying library prints is told by the parent
  for (const int output : {STDOUT_FILENO, STDERR_FILENO})
    if (nowhere >= 0) ::dup2(nowhere, output);
#endif
  static int status = 0;
  std::atexit([] { _exit(status); });  // registered last, called first: nothing of the parent's is flushed or closed a second time
  try {
    work([pipe](std::string_view bytes) { write_all(pipe, bytes); });
  } catch (...) {
    status = 1;
  }
  _exit(status);
}

/// What is left of a time [ms], for poll().
int left(Clock::time_point start, double seconds) {
  if (!std::isfinite(seconds)) return -1;
  const double passed = std::chrono::duration<double>(Clock::now() - start).count();
  return static_cast<int>(std::clamp(1e3 * (seconds - passed), 0.0, 1e9));
}

}  // namespace

ChildEnd run_in_child(const std::function<void(const Say&)>& work, const ChildLimits& limits) {
  int pipe[2];
  if (::pipe(pipe) != 0) return {ChildEnd::How::not_started, errno, {}};
  std::fflush(nullptr);
  const Clock::time_point start = Clock::now();
  const pid_t pid = ::fork();
  if (pid < 0) {
    const int why = errno;
    ::close(pipe[0]), ::close(pipe[1]);
    return {ChildEnd::How::not_started, why, {}};
  }
  if (pid == 0) {
    ::close(pipe[0]);
    child(pipe[1], work, limits);
  }
  ::close(pipe[1]);
  ChildEnd end{ChildEnd::How::ended, 0, {}};
  for (char block[1 << 16]; end.said.size() <= limits.memory;) {
    pollfd said{pipe[0], POLLIN, 0};
    const int ready = ::poll(&said, 1, left(start, limits.wall_s));
    if (ready < 0 && errno == EINTR) continue;
    if (ready == 0) end.how = ChildEnd::How::late;
    if (ready <= 0) break;
    const ssize_t n = ::read(pipe[0], block, sizeof block);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    end.said.append(block, static_cast<std::size_t>(n));
  }
  ::close(pipe[0]);  // before the wait: a child that writes without end ends here
  timespec pause{0, 50'000};
  int status = 0;
  for (;;) {  // its end of the pipe may be closed by a child that goes on
    const pid_t ended = ::waitpid(pid, &status, std::isfinite(limits.wall_s) ? WNOHANG : 0);
    if (ended == pid || (ended < 0 && errno != EINTR)) break;
    if (left(start, limits.wall_s) == 0) {
      end.how = ChildEnd::How::late;
      ::kill(pid, SIGKILL);
      while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
      }
      break;
    }
    if (ended == 0) nanosleep(&pause, nullptr);
    pause.tv_nsec = std::min(2 * pause.tv_nsec, 5'000'000L);
  }
  if (end.how == ChildEnd::How::late) return end;
  if (WIFSIGNALED(status)) return {ChildEnd::How::killed, WTERMSIG(status), std::move(end.said)};
  end.status = WEXITSTATUS(status);
  return end;
}

}  // namespace cardan
