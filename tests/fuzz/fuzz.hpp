#pragma once
// Fuzzing in this process: inputs that follow from a seed alone, in the same order each time. Each must end in success or in
// a typed error whose JSON is valid; any other exception, a crash, more than kMostCpu of processor time or kMostMemory is a failure.
//
//   CARDAN_FUZZ_INPUTS=1000000   that many inputs instead of 2 s of them
//   CARDAN_FUZZ_FIRST=1234       begin with this one: with CARDAN_FUZZ_INPUTS=1 one input again
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace cardan::fuzz {

/// Numbers that follow from the index of an input.
class Random {
 public:
  explicit Random(std::uint64_t index) : index_(index), engine_(index * 0x9E3779B97F4A7C15u + 1) {}
  std::uint64_t index() const { return index_; }
  /// 0 ... n - 1; the same on every machine, unlike std::uniform_int_distribution.
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(engine_() % n); }
  bool one_in(std::size_t n) { return below(n) == 0; }
  template <class List>
  const auto& of(const List& list) {
    return list[below(std::size(list))];
  }

 private:
  std::uint64_t index_;
  std::mt19937_64 engine_;
};

/// Thrown by an attempt whose input could not be made. It is counted apart: nothing was tried.
struct NotMade {};

/// Runs `attempt(random, index)` for one input after another, for 2 s or as many as asked for. `attempt` makes its input from
/// `random`, calls `keep` with what would show the failure again (a text, or the bytes of a file), and reads it.
/// The failing input is written to fuzz_NAME_INDEX beside the test program.
using Keep = std::function<void(std::string)>;
void run(const std::string& name, const std::function<void(Random&, const Keep& keep)>& attempt);

/// A text with one to eight changes: bytes, words, numbers, lines, pieces of another text.
std::string mutated(const std::string& text, const std::vector<std::string>& others, const std::vector<std::string>& words, Random& random);

/// Bytes with one to eight of them changed, now and then a part zeroed or the end cut off.
std::string with_flipped_bytes(std::string bytes, Random& random);

/// Contents of the files below these folders of the sources with this ending, in the order of their names; those of more than 20 kB
/// are left out.
std::vector<std::string> sources(const std::vector<std::string>& folders, const std::string& ending);

std::string content(const std::string& path);
void write(const std::string& path, const std::string& bytes);

}  // namespace cardan::fuzz
