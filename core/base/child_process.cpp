#include "core/base/child_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
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
#include <utility>

#include "core/base/poll.hpp"

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
  for (const int s : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGALRM, SIGPIPE}) ::signal(s, SIG_DFL);
  for (const int s : {SIGINT, SIGTERM, SIGHUP}) ::signal(s, SIG_IGN);  // the parent decides what they mean for this one
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
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

/// The parent's side. A child that is left before it ended is killed.
class Running {
 public:
  Running(pid_t pid, int pipe) : pid_(pid), pipe_(pipe) {}
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  ~Running() {
    hang_up();
    if (pid_ < 0) return;
    ::kill(pid_, SIGKILL);
    while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }

  /// Waits some milliseconds for more of what it says; false: there will be no more.
  bool listen(std::string& said, int milliseconds) const {
    pollfd more{pipe_, POLLIN, 0};
    const int ready = ::poll(&more, 1, milliseconds);
    if (ready == 0 || (ready < 0 && errno == EINTR)) return true;
    char block[1 << 16];
    const ssize_t n = ready < 0 ? -1 : ::read(pipe_, block, sizeof block);
    if (n > 0) said.append(block, static_cast<std::size_t>(n));
    return n > 0 || (n < 0 && errno == EINTR);
  }
  /// A child that says more then ends of SIGPIPE.
  void hang_up() {
    if (pipe_ >= 0) ::close(std::exchange(pipe_, -1));
  }
  /// Its status, once it has ended.
  bool has_ended(int& status) {
    const pid_t ended = ::waitpid(pid_, &status, WNOHANG);
    if (ended != 0) pid_ = -1;
    return ended != 0;
  }

 private:
  pid_t pid_;
  int pipe_;
};

}  // namespace

ChildEnd run_in_child(const std::function<void(const Say&)>& work, const ChildLimits& limits) {
  int pipe[2];
  if (::pipe(pipe) != 0) return {ChildEnd::How::not_started, errno, {}};
  std::fflush(nullptr);
  const Clock::time_point start = Clock::now();
  const auto late = [&] { return std::chrono::duration<double>(Clock::now() - start).count() > limits.wall_s; };
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
  Running running(pid, pipe[0]);
  ChildEnd end{ChildEnd::How::late, 0, {}};
  while (running.listen(end.said, 50) && end.said.size() <= limits.memory) {
    Poll::now();
    if (late()) return end;
  }
  running.hang_up();
  timespec pause{0, 50'000};
  for (int status = 0; !late(); nanosleep(&pause, nullptr)) {  // its end of the pipe may be closed by a child that goes on
    if (running.has_ended(status)) {
      const bool killed = WIFSIGNALED(status);
      return {killed ? ChildEnd::How::killed : ChildEnd::How::ended, killed ? WTERMSIG(status) : WEXITSTATUS(status), std::move(end.said)};
    }
    Poll::now();
    pause.tv_nsec = std::min(2 * pause.tv_nsec, 5'000'000L);
  }
  return end;
}

namespace {

double now_s() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

}  // namespace

RunningProgram::RunningProgram(const ProgramOrder& order)
    : limits_(order.limits), end_{ChildEnd::How::not_started, 0, {}}, started_(now_s()) {
  std::vector<char*> arguments, environment;
  std::vector<std::string> texts;
  for (const auto& [name, value] : order.environment) texts.push_back(name + "=" + value);
  for (char** given = environ; *given != nullptr; ++given) {
    const std::string_view text = *given;
    const bool replaced = std::any_of(order.environment.begin(), order.environment.end(),
                                      [&](const auto& more) { return text.starts_with(more.first + "="); });
    if (!replaced) environment.push_back(*given);
  }
  for (const std::string& text : texts) environment.push_back(const_cast<char*>(text.c_str()));
  for (const std::string& text : order.command) arguments.push_back(const_cast<char*>(text.c_str()));
  arguments.push_back(nullptr);
  environment.push_back(nullptr);
  std::fflush(nullptr);
  pid_ = ::fork();
  if (pid_ < 0) {
    end_.status = errno;
    return;
  }
  if (pid_ > 0) return;
  // The child: system calls alone.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  limit(RLIMIT_CORE, 0.0, 0.0);
  const double cpu_s = std::ceil(limits_.cpu_s);
  limit(RLIMIT_CPU, cpu_s, cpu_s + 1.0);
  if (const auto bytes = static_cast<double>(limits_.file_size); bytes > 0.0) limit(RLIMIT_FSIZE, bytes, bytes);
#ifndef CARDAN_ADDRESS_CHECKS
  limit(RLIMIT_AS, static_cast<double>(limits_.memory), static_cast<double>(limits_.memory));
#endif
  const int in = ::open("/dev/null", O_RDONLY), out = ::open(order.out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666),
            err = ::open(order.err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (in < 0 || out < 0 || err < 0) _exit(127);
  ::dup2(in, STDIN_FILENO), ::dup2(out, STDOUT_FILENO), ::dup2(err, STDERR_FILENO);
  ::execve(arguments[0], arguments.data(), environment.data());
  _exit(127);
}

RunningProgram::~RunningProgram() {
  if (pid_ < 0) return;
  ::kill(pid_, SIGKILL);
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

bool RunningProgram::has_ended() {
  if (pid_ < 0) return true;
  const bool late = now_s() - started_ > limits_.wall_s;
  if (late) ::kill(pid_, SIGKILL);
  int status = 0;
  rusage used{};
  const pid_t ended = ::wait4(pid_, &status, late ? 0 : WNOHANG, &used);
  if (ended == 0 || (ended < 0 && errno == EINTR)) return false;
  pid_ = -1;
  wall_s_ = now_s() - started_;
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  cpu_s_ = seconds(used.ru_utime) + seconds(used.ru_stime);
  const bool killed = WIFSIGNALED(status);
  end_ = {late     ? ChildEnd::How::late
          : killed ? ChildEnd::How::killed
                   : ChildEnd::How::ended,
          killed ? WTERMSIG(status) : WEXITSTATUS(status),
          {}};
  return true;
}

}  // namespace cardan
