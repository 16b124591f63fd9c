#include "tests/fuzz/fuzz.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "core/base/child_process.hpp"
#include "core/base/diagnostic.hpp"
#include "core/io/json.hpp"

namespace cardan::fuzz {
namespace {

constexpr double kSeconds = 2.0;                                  // of the default run
constexpr int kMostCpu = 60;                                      // [s] of one input
[[maybe_unused]] constexpr double kMostMemory = 6.0 * (1 << 30);  // [bytes] of the whole program

char current[128] = "";  // which input is tried, for the handler

extern "C" void tell_and_die(int signal) {
  const char* why = signal == SIGVTALRM ? " takes too long\n" : " crashes\n";
  for (const char* text : {"\nfuzz: ", static_cast<const char*>(current), why})
    if (::write(STDERR_FILENO, text, std::strlen(text)) < 0) break;
  std::signal(signal, SIG_DFL);
  std::raise(signal == SIGVTALRM ? SIGABRT : signal);
}

void limit_time(int seconds) {
  itimerval timer{};
  timer.it_value.tv_sec = seconds;
  setitimer(ITIMER_VIRTUAL, &timer, nullptr);
}

void limit_this_process() {
  static bool done = false;
  if (done) return;
  done = true;
  std::signal(SIGVTALRM, tell_and_die);
#ifndef CARDAN_ADDRESS_CHECKS
  for (int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL}) std::signal(signal, tell_and_die);
  rlimit memory{};
  getrlimit(RLIMIT_AS, &memory);
  memory.rlim_cur = static_cast<rlim_t>(kMostMemory);
  setrlimit(RLIMIT_AS, &memory);
#endif
}

std::uint64_t number_of_environment(const char* name, std::uint64_t fallback) {
  const char* text = std::getenv(name);
  return text ? std::strtoull(text, nullptr, 10) : fallback;
}

/// What is wrong with the errors of an input; empty if all is well.
std::string fault_of(const Json& errors) {
  const std::string text = json_text(errors);
  return Json::accept(text) ? "" : "its JSON is not valid:\n" + text;
}

}  // namespace

void run(const std::string& name, const std::function<void(Random&, const Keep&)>& attempt) {
  limit_this_process();
  const std::uint64_t count = number_of_environment("CARDAN_FUZZ_INPUTS", 0), first = number_of_environment("CARDAN_FUZZ_FIRST", 0);
  const auto start = std::chrono::steady_clock::now();
  std::uint64_t good = 0, refused = 0, failed = 0, not_made = 0, i = first;
  const auto on = [&] {
    return count > 0 ? i < first + count : std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < kSeconds;
  };
  for (; on() && failed < 20; ++i) {
    *fmt::format_to_n(current, sizeof current - 1, "{} of {} (CARDAN_FUZZ_FIRST={} CARDAN_FUZZ_INPUTS=1)", i, name, i).out = '\0';
    std::string input, fault;
    Random random(i);
    limit_time(kMostCpu);
    try {
      attempt(random, [&](std::string kept) { input = std::move(kept); });
      ++good;
    } catch (const InputError& e) {
      Json all = Json::array();
      for (const Diagnostic& d : e.diagnostics()) all.push_back(to_json(d));
      fault = all.empty() ? "an InputError without a diagnostic" : fault_of(all);
      ++refused;
    } catch (const NumericsError& e) {
      fault = fault_of(to_json(e.failure()));
      ++refused;
    } catch (const NotMade&) {
      ++not_made;
    } catch (const std::exception& e) {
      fault = fmt::format("neither success nor a typed error: {}", e.what());
    }
    limit_time(0);
    if (fault.empty()) continue;
    ++failed;
    const std::string kept = fmt::format("{}/tests/fuzz_{}_{}", CARDAN_BINARY_DIR, name, i);
    write(kept, input);
    ADD_FAILURE() << "input " << i << " of " << name << ", kept in " << kept << ": " << fault;
  }
  fmt::print("fuzz {}: {} inputs from {} on, {} taken, {} refused with a typed error, {} failed", name, i - first, first, good, refused,
             failed);
  if (not_made > 0) fmt::print(", {} could not be made", not_made);
  fmt::print("\n");
  std::fflush(stdout);
}

namespace {

const std::vector<std::string> kNumbers = {"0",       "-0",     "1",     "-1",         "2",          "3",
                                           "1e308",   "-1e308", "1e309", "5e-324",     "1e-310",     "nan",
                                           "inf",     "-inf",   "1e9",   "2147483648", "4294967296", "9223372036854775808",
                                           "0x10",    "1e",     "1_000", "0.1.2",      ".5",         "5.",
                                           "1e-1000", "00",     "1e1",   "100000000",  "1,5",        "+1"};
const std::vector<std::string> kBytes = {"\0", "\xff", "\xc3", "\xed\xa0\x80", "\t", "\r\n", "\xef\xbb\xbf", "\x1b[31m", "\x7f"};

/// Beginnings and ends of words and numbers.
std::vector<std::pair<std::size_t, std::size_t>> words_of(const std::string& text) {
  const auto part = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '.' || c == '-'; };
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (std::size_t i = 0; i < text.size();) {
    std::size_t end = i;
    while (end < text.size() && part(text[end])) ++end;
    if (end > i) out.emplace_back(i, end - i);
    i = end + 1;
  }
  return out;
}

std::pair<std::size_t, std::size_t> line_of(const std::string& text, std::size_t at) {
  const std::size_t before = at == 0 ? std::string::npos : text.rfind('\n', at - 1);
  const std::size_t start = before == std::string::npos ? 0 : before + 1, end = text.find('\n', start);
  return {start, (end == std::string::npos ? text.size() : end + 1) - start};
}

void mutate_once(std::string& text, const std::vector<std::string>& others, const std::vector<std::string>& words, Random& random) {
  if (text.empty()) text = random.of(others);
  const std::size_t at = random.below(text.size() + 1);
  const auto place = [&] { return std::min(random.below(text.size() + 1), text.size() - 1); };
  switch (random.below(12)) {
    case 0:  // a byte
      text[place()] = static_cast<char>(random.below(256));
      return;
    case 1:
      text.insert(at, random.of(kBytes));
      return;
    case 2:
      text.erase(at, 1 + random.below(8));
      return;
    case 3: {  // a sign of the grammar
      static const std::string signs = ",:[]{}\"'&*!|>#%?-=()<>.;\n \\";
      text.insert(at, 1, signs[random.below(signs.size())]);
      return;
    }
    case 4:
    case 5:
    case 6: {  // a word or a number, by another one
      const auto all = words_of(text);
      if (all.empty()) return;
      const auto [start, length] = random.of(all);
      const bool number = std::isdigit(static_cast<unsigned char>(text[start])) || text[start] == '-';
      text.replace(start, length, number != random.one_in(4) ? random.of(kNumbers) : random.of(words));
      return;
    }
    case 7: {  // a word of the text itself
      const auto all = words_of(text);
      if (all.empty()) return;
      const auto [from, n] = random.of(all);
      const std::string word = text.substr(from, n);
      const auto [to, m] = random.of(all);
      text.replace(to, m, word);
      return;
    }
    case 8: {  // a line away
      const auto [start, length] = line_of(text, place());
      text.erase(start, length);
      return;
    }
    case 9: {  // a line again, somewhere
      const auto [start, length] = line_of(text, place());
      const std::string line = text.substr(start, length);
      text.insert(line_of(text, place()).first, line);
      return;
    }
    case 10: {  // a piece of another text
      const std::string& other = random.of(others);
      const auto [start, length] = line_of(other, random.below(other.size() + 1));
      text.insert(line_of(text, place()).first, other.substr(start, length * (1 + random.below(4))));
      return;
    }
    default: {  // a short piece many times
      const std::size_t from = place();
      const std::string piece = text.substr(from, 1 + random.below(12));
      const std::size_t times = random.one_in(20) ? 2000 : 1 + random.below(40);
      std::string all;
      for (std::size_t i = 0; i < times; ++i) all += piece;
      text.insert(from, all);
    }
  }
}

}  // namespace

std::string mutated(const std::string& text, const std::vector<std::string>& others, const std::vector<std::string>& words,
                    Random& random) {
  std::string out = text;
  for (std::size_t n = 1 + random.below(random.one_in(3) ? 8 : 2); n > 0; --n) mutate_once(out, others, words, random);
  return out;
}

std::string with_flipped_bytes(std::string bytes, Random& random) {
  for (std::size_t n = 1 + random.below(8); n > 0; --n) {
    char& byte = bytes[random.below(bytes.size())];
    if (random.one_in(2))
      byte = static_cast<char>(byte ^ (1 << random.below(8)));
    else
      byte = static_cast<char>(random.below(256));
  }
  if (random.one_in(20)) {
    const std::size_t at = random.below(bytes.size()), end = std::min(bytes.size(), at + 1 + random.below(512));
    std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.begin() + static_cast<std::ptrdiff_t>(end),
              random.one_in(2) ? '\0' : '\xff');
  }
  if (random.one_in(50)) bytes.resize(random.below(bytes.size()));
  return bytes;
}

std::vector<std::string> sources(const std::vector<std::string>& folders, const std::string& ending) {
  namespace fs = std::filesystem;
  std::vector<std::string> paths, out;
  for (const std::string& folder : folders)
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(CARDAN_SOURCE_DIR) / folder))
      if (entry.path().extension() == ending && entry.file_size() < 20'000) paths.push_back(entry.path().string());
  std::sort(paths.begin(), paths.end());
  for (const std::string& path : paths) out.push_back(content(path));
  return out;
}

std::string content(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write(const std::string& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

}  // namespace cardan::fuzz
