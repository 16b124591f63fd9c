#include "core/io/bounded_child.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <new>

#include "core/base/diagnostic.hpp"

namespace cardan {
namespace {

enum class Answer : std::size_t { bytes, input_error, numerics_error, other };

[[noreturn]] void refuse(const std::string& file, std::string got, std::string hint = "the file is damaged") {
  throw InputError({Code::bad_result_file, {"", {file, 0, 0}}, "a file that can be read", std::move(got), std::move(hint), "", "", 0});
}

void write(ByteWriter& out, const Diagnostic& d) {
  out.number(static_cast<std::size_t>(d.code));
  for (const std::string* text : {&d.at.key_path, &d.at.mark.file, &d.expected, &d.got, &d.hint, &d.stack, &d.about})
    out.text(*text);
  for (int number : {d.at.mark.line, d.at.mark.column, d.span}) out.number(static_cast<std::size_t>(number));
}
Diagnostic read_diagnostic(ByteReader& in) {
  Diagnostic d{};
  d.code = static_cast<Code>(in.number());
  for (std::string* text : {&d.at.key_path, &d.at.mark.file, &d.expected, &d.got, &d.hint, &d.stack, &d.about})
    *text = in.text();
  for (int* number : {&d.at.mark.line, &d.at.mark.column, &d.span}) *number = static_cast<int>(in.number());
  return d;
}

void write(ByteWriter& out, const RunFailure& f) {
  out.number(static_cast<std::size_t>(f.code));
  out.raw(&f.t, sizeof f.t);
  for (const std::string* text : {&f.body, &f.hinge, &f.what, &f.hint, &f.last_good}) out.text(*text);
}
RunFailure read_failure(ByteReader& in) {
  RunFailure f{};
  f.code = static_cast<Code>(in.number());
  in.raw(&f.t, sizeof f.t);
  for (std::string* text : {&f.body, &f.hinge, &f.what, &f.hint, &f.last_good}) *text = in.text();
  return f;
}

/// What the child sends: the kind of its answer, then the answer.
std::string answer_of(const std::function<std::string()>& work, const ChildLimits& limits) {
  ByteWriter out;
  const auto kind = [&](Answer a) { out.number(static_cast<std::size_t>(a)); };
  try {
    const std::string bytes = work();
    kind(Answer::bytes);
    out.raw(bytes.data(), bytes.size());
  } catch (const InputError& e) {
    kind(Answer::input_error);
    out.number(e.diagnostics().size());
    for (const Diagnostic& d : e.diagnostics()) write(out, d);
  } catch (const NumericsError& e) {
    kind(Answer::numerics_error);
    write(out, e.failure());
  } catch (const std::bad_alloc&) {
    kind(Answer::other);
    out.text(fmt::format("it takes more than {} MiB of memory to read", limits.memory >> 20));
  } catch (const std::exception& e) {
    kind(Answer::other);
    out.text(e.what());
  }
  return out.take();
}

void limit(int resource, double value) {
  rlimit limits{};
  getrlimit(static_cast<__rlimit_resource>(resource), &limits);
  const auto wanted = static_cast<rlim_t>(value);
  if (limits.rlim_max == RLIM_INFINITY || wanted < limits.rlim_max) limits.rlim_cur = wanted;
  setrlimit(static_cast<__rlimit_resource>(resource), &limits);
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

[[noreturn]] void child(int pipe, const std::function<std::string()>& work, const ChildLimits& limits) {
  for (int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGXCPU}) ::signal(signal, SIG_DFL);
  limit(RLIMIT_CORE, 0.0);
  limit(RLIMIT_CPU, std::ceil(limits.cpu_s));
#ifndef CARDAN_ADDRESS_CHECKS
  limit(RLIMIT_AS, address_space() + static_cast<double>(limits.memory));
  if (!std::freopen("/dev/null", "w", stderr)) _exit(1);  // what a dying library prints is answered by the parent
#endif
  const std::string answer = answer_of(work, limits);
  for (std::size_t sent = 0; sent < answer.size();) {
    const ssize_t n = ::write(pipe, answer.data() + sent, answer.size() - sent);
    if (n < 0 && errno != EINTR) _exit(1);
    if (n > 0) sent += static_cast<std::size_t>(n);
  }
  _exit(0);  // no destructor, no buffer of the parent's
}

std::string all_of(int pipe, std::size_t most) {
  std::string bytes;
  char block[1 << 16];
  for (;;) {
    const ssize_t n = ::read(pipe, block, sizeof block);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0 || bytes.size() > most) return bytes;
    bytes.append(block, static_cast<std::size_t>(n));
  }
}

}  // namespace

ChildLimits ChildLimits::for_file(const std::string& path) {
  std::error_code none;
  const auto size = std::filesystem::file_size(path, none);
  const double bytes = none ? 0.0 : static_cast<double>(size);
  ChildLimits limits;
  limits.cpu_s += bytes / 20e6;
  limits.memory += static_cast<std::size_t>(8.0 * bytes);
  return limits;
}

std::string in_bounded_child(const std::string& file, const std::function<std::string()>& work,
                             const ChildLimits& limits) {
  int pipe[2];
  if (::pipe(pipe) != 0) refuse(file, fmt::format("no pipe to a process that reads it: {}", std::strerror(errno)), "");
  const pid_t pid = ::fork();
  if (pid < 0) {
    const int why = errno;
    ::close(pipe[0]);
    ::close(pipe[1]);
    refuse(file, fmt::format("no process to read it: {}", std::strerror(why)), "");
  }
  if (pid == 0) {
    ::close(pipe[0]);
    child(pipe[1], work, limits);
  }
  ::close(pipe[1]);
  const std::string bytes = all_of(pipe[0], limits.memory);
  ::close(pipe[0]);  // before the wait: a child that writes without end ends here
  int status = 0;
  pid_t ended = 0;
  while ((ended = ::waitpid(pid, &status, 0)) < 0 && errno == EINTR) {
  }
  if (ended == pid && WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU)
    refuse(file, fmt::format("reading it takes more than {:g} s of processor time", std::ceil(limits.cpu_s)));
  if (ended == pid && WIFSIGNALED(status))
    refuse(file, fmt::format("the library that reads it crashed ({})", strsignal(WTERMSIG(status))));
  if (ended == pid && status != 0) refuse(file, "the library that reads it gave up");
  try {
    ByteReader in(bytes);
    switch (static_cast<Answer>(in.number())) {
      case Answer::bytes:
        return bytes.substr(bytes.size() - in.left());
      case Answer::input_error: {
        std::vector<Diagnostic> all(std::min(in.number(), bytes.size()));
        for (Diagnostic& d : all) d = read_diagnostic(in);
        throw InputError(std::move(all));
      }
      case Answer::numerics_error:
        throw NumericsError(read_failure(in));
      default:
        refuse(file, in.text());
    }
  } catch (const std::out_of_range&) {
    refuse(file, "the process that reads it gave half an answer");
  }
}

}  // namespace cardan
