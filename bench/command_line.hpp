#pragma once
// The command line of a benchmark. CLI11 reads it and is compiled once, which takes three seconds in each file that names it.
#include <memory>
#include <optional>
#include <string>

namespace cardan::bench {

class CommandLine {
 public:
  explicit CommandLine(const std::string& what);  // the program is for
  ~CommandLine();
  /// Fills `value`, whose present value is the default. A bool is a flag. No help: `--help` does not show it.
  CommandLine& option(const std::string& name, std::string& value, const std::string& help = {});
  CommandLine& option(const std::string& name, double& value, const std::string& help);
  CommandLine& option(const std::string& name, int& value, const std::string& help);  // at least 1
  CommandLine& option(const std::string& name, bool& value, const std::string& help);
  /// With what the program ends at once: 0 after --help, 2 after words that are no options, which are told.
  std::optional<int> parse(int argc, const char* const* argv);

 private:
  struct App;
  std::unique_ptr<App> app_;
};

}  // namespace cardan::bench
