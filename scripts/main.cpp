// The program `cardan`.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "scripts/commands/program.hpp"

namespace {

bool main_is_over = false;

}  // namespace

int main(int argc, char** argv) {
  std::atexit([] {  // a plugin that calls exit() must not look like a run that went well
    if (main_is_over) return;
    std::fputs("internal error: the process was ended from inside (exit); is a plugin loaded?\n", stderr);
    _exit(70);
  });
  const int code = cardan::run_command_line(argc, argv);
  main_is_over = true;
  return code;
}
