#include "scripts/commands/streams.hpp"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <string>

#include "core/base/utf8.hpp"

namespace cardan {
namespace {

int fault = 0;  // errno of the first write to standard output that failed

void note_fault() {
  if (fault == 0 && std::ferror(stdout)) fault = errno != 0 ? errno : EIO;
}

/// A pipe whose reader has ended; whatever wrote to it, and however that failed.
bool is_unread(int descriptor) {
  pollfd p{descriptor, POLLOUT, 0};
  return poll(&p, 1, 0) > 0 && (p.revents & POLLERR) != 0;
}

/// Lines without control characters: names of files and arguments are in them.
std::string lines(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of("\n\t"), text.size());
    out += printable(text.substr(0, end));
    if (end < text.size()) out += text[end];
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

void put(std::FILE* stream, std::string_view text) {
  errno = 0;
  std::fwrite(text.data(), 1, text.size(), stream);
  std::fflush(stream);
  if (stream == stdout) note_fault();
}

}  // namespace

void open_standard_streams() {
  for (int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})  // in this order: open() takes the lowest that is free
    if (fcntl(descriptor, F_GETFD) < 0 && open("/dev/null", O_RDWR) < 0) return;
  std::signal(SIGPIPE, SIG_IGN);
}

void say(std::string_view text) { put(stdout, lines(text)); }
void complain(std::string_view text) { put(stderr, lines(text)); }
void draw(std::string_view text) { put(stderr, text); }

void note_output_fault(int error) {
  if (fault == 0) fault = error;
}

std::string_view output_fault() {
  put(stdout, {});
  return fault == 0 || is_unread(STDOUT_FILENO) ? std::string_view() : std::strerror(fault);
}

}  // namespace cardan
