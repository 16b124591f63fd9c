#pragma once
// Instructions that a call takes, counted by callgrind (Valgrind): what a clock cannot tell from the speed of memory. A program that
// wants to count starts itself again under it; dumps go to a directory of their own.
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#define CARDAN_HAS_CALLGRIND 1
#endif

namespace cardan::bench {

class OperationCount {
 public:
  /// Inside of callgrind, started by run_under_callgrind() with this directory.
  explicit OperationCount(std::filesystem::path dumps) : dumps_(std::move(dumps)) {}

  template <class Call>
  double operator()(const Call& call) {
    call();  // memory that is kept is there afterwards
#ifdef CARDAN_HAS_CALLGRIND
    CALLGRIND_ZERO_STATS;
    CALLGRIND_TOGGLE_COLLECT;
    call();
    CALLGRIND_TOGGLE_COLLECT;
    CALLGRIND_DUMP_STATS;
#endif
    const std::filesystem::path dump = dumps_ / ("out." + std::to_string(++count_));
    std::ifstream in(dump);
    double total = 0.0;
    for (std::string word; in >> word;)
      if (word == "summary:" || word == "totals:") in >> total;
    in.close();
    std::filesystem::remove(dump);
    return total;
  }

 private:
  std::filesystem::path dumps_;
  int count_ = 0;
};

/// Runs `program arguments --dumps DIRECTORY` under callgrind and waits: its exit code; nothing where there is no Valgrind.
inline std::optional<int> run_under_callgrind(const std::string& program, std::vector<std::string> arguments) {
#ifdef CARDAN_HAS_CALLGRIND
  const std::filesystem::path dumps = std::filesystem::temp_directory_path() / ("cardan_operations." + std::to_string(getpid()));
  std::filesystem::create_directories(dumps);
  arguments.insert(arguments.begin(), {"valgrind", "-q", "--tool=callgrind", "--collect-atstart=no",
                                       "--callgrind-out-file=" + (dumps / "out").string(), program});
  arguments.insert(arguments.end(), {"--dumps", dumps.string()});
  std::vector<char*> argv;
  for (std::string& a : arguments) argv.push_back(a.data());
  argv.push_back(nullptr);
  constexpr int kNotFound = 127;
  const pid_t child = fork();
  if (child == 0) {
    // else glibc copies long vectors by one instruction that is counted once a byte
    setenv("GLIBC_TUNABLES", "glibc.cpu.x86_rep_movsb_threshold=1000000000:glibc.cpu.x86_rep_stosb_threshold=1000000000", 1);
    execvp(argv[0], argv.data());
    _exit(kNotFound);
  }
  int status = 0;
  if (child > 0) waitpid(child, &status, 0);
  std::filesystem::remove_all(dumps);
  if (child > 0 && WIFEXITED(status) && WEXITSTATUS(status) != kNotFound) return WEXITSTATUS(status);
#endif
  return std::nullopt;
}

}  // namespace cardan::bench
