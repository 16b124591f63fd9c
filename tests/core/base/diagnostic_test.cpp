#include "core/base/diagnostic.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

/// A source file, for as long as a test runs.
class SourceFile {
 public:
  explicit SourceFile(const std::string& text) {
    std::filesystem::current_path(folder_.path());
    std::ofstream("source.txt", std::ios::binary) << text;
  }
  ~SourceFile() { std::filesystem::current_path(before_); }

 private:
  TemporaryFolder folder_;
  std::filesystem::path before_ = std::filesystem::current_path();
};

Diagnostic at(int line, int column) {
  return {Code::unknown_hinge_type,
          {"bodies.panel.hinge.type", {"source.txt", line, column}},
          "a hinge type: ball or free",
          "\"bal\"",
          "did you mean \"ball\"?",
          {},
          {},
          0};
}

TEST(Diagnostic, SaysWhereWhichKeyWhatWasExpectedAndWhatNow) {
  const SourceFile file("a: 1\n  type: bal   # a ball\n");
  EXPECT_EQ(render(at(2, 9)),
            "error[C0204]: unknown hinge type\n"
            "  --> source.txt:2:9\n"
            "  at: bodies.panel.hinge.type\n"
            "    2 |   type: bal   # a ball\n"
            "      |         ^^^\n"
            "  expected: a hinge type: ball or free\n"
            "  got:      \"bal\"\n"
            "  hint:     did you mean \"ball\"?\n");
}

TEST(Diagnostic, WithoutAPlaceLeavesItOut) {
  Diagnostic d = at(0, 0);
  d.at = {};
  d.hint.clear();
  EXPECT_EQ(render(d), "error[C0204]: unknown hinge type\n  expected: a hinge type: ball or free\n  got:      \"bal\"\n");
}

TEST(Diagnostic, OfALineWithoutColumnShowsTheLine) {
  const SourceFile file("run{}\n");
  EXPECT_NE(render(at(1, 0)).find("  --> source.txt:1\n  at: bodies.panel.hinge.type\n    1 | run{}\n  expected"), std::string::npos);
}

TEST(Diagnostic, OfAFileThatIsGoneStillNamesThePlace) {
  EXPECT_NE(render(at(3, 4)).find("  --> source.txt:3:4\n  at: bodies.panel.hinge.type\n  expected"), std::string::npos);
}

std::string marked(const std::string& line, int column) {
  const SourceFile file(line + "\n");
  const std::string text = render(at(1, column));
  const auto start = text.find("      | ");
  if (start == std::string::npos) return "";
  return text.substr(start + 8, text.find('\n', start) - start - 8);
}

TEST(Diagnostic, UnderlinesTheWholeValue) {
  EXPECT_EQ(marked("mass: 12 kg  # dry", 7), "      ^^^^^");
  EXPECT_EQ(marked("{mass: 12 kg, com: 0}", 8), "       ^^^^^");
  EXPECT_EQ(marked("[\"12 kg, or so\", 1]", 2), " ^^^^^^^^^^^^^^");
  EXPECT_EQ(marked("com: [0, [1, 2]] # c", 6), "     ^^^^^^^^^^^");
  EXPECT_EQ(marked("  key:", 3), "  ^^^");
  EXPECT_EQ(marked("  key: 1", 3), "  ^^^");
  EXPECT_EQ(marked("x: [1, 2", 4), "   ^^^^^");
  EXPECT_EQ(marked("short", 40), "");
}

TEST(Diagnostic, CountsCharactersNotBytes) {
  EXPECT_EQ(marked("é: ü", 5), "   ^");
  EXPECT_EQ(marked("a\tb: x", 3), "  ^");
}

TEST(Diagnostic, ShowsAPartOfALongLine) {
  const std::string line = std::string(500, 'a') + ": wrong " + std::string(500, 'b');
  const SourceFile file(line + "\n");
  const std::string text = render(at(1, 503));
  EXPECT_LT(text.size(), 600u);
  EXPECT_NE(text.find("aaa: wrong bbb"), std::string::npos);
}

TEST(Diagnostic, IsTextWhateverTheFileHolds) { EXPECT_EQ(marked("a\xff\x01: x", 6), "     ^"); }

TEST(Diagnostics, EndWithTheirCount) {
  EXPECT_EQ(render(std::vector<Diagnostic>{{Code::empty_system, {}, "one", "none", {}, {}, {}, 0}}),
            "error[C0209]: nothing to simulate\n  expected: one\n  got:      none\n\n1 error. Nothing was run.\n");
}

TEST(DidYouMean, FindsTheNearestWithinTwoEdits) {
  const std::vector<std::string> legal = {"prismatic", "revolute", "ball", "free"};
  EXPECT_EQ(did_you_mean("revolut", legal), "did you mean \"revolute\"?");
  EXPECT_EQ(did_you_mean("fere", legal), "did you mean \"free\"?") << "two letters the wrong way round are one change";
  EXPECT_EQ(did_you_mean("revo", legal), "");
  EXPECT_EQ(did_you_mean(std::string(1000000, 'x'), legal), "");
  EXPECT_EQ(did_you_mean("gain", {"wait"}), "") << "two of four letters are another word";
  EXPECT_EQ(did_you_mean("base", {"bus"}), "");
  EXPECT_EQ(did_you_mean("xy", {"m"}), "") << "a word that shares nothing is no suggestion";
}

TEST(DiagnosticSink, KeepsTheFirstFaultOfEachValue) {
  DiagnosticSink sink;
  sink.report(Code::bad_number, {"bodies.bus.com[1]", {}}, "", "");
  sink.report(Code::out_of_range, {"bodies.bus.com", {}}, "", "");
  sink.report(Code::out_of_range, {"bodies.bus.com[1]", {}}, "", "");
  sink.report(Code::out_of_range, {"bodies.bus.co", {}}, "", "");
  EXPECT_EQ(sink.all().size(), 2u);
}

TEST(DiagnosticSink, StopsAtTwenty) {
  DiagnosticSink sink;
  for (int i = 0; i < 50; ++i) sink.report(Code::unknown_key, {"key" + std::to_string(i) + "_", {}}, "", "");
  EXPECT_TRUE(sink.full());
  EXPECT_EQ(sink.all().size(), 20u);
  EXPECT_THROW(sink.throw_if_any(), InputError);
}

TEST(RunFailure, SaysWhenWhereAndWhatIsLeft) {
  EXPECT_EQ(render(RunFailure{Code::singular_hinge, 12.4471, "panel_2", "panel_2.root", "D = 3.1e-19 kg m^2, limit 1e-12",
                              "massless tip body?", "out/run.h5"}),
            "failure[N0107]: articulated hinge inertia is singular\n"
            "  t = 12.4471 s   body: panel_2   hinge: panel_2.root\n"
            "  D = 3.1e-19 kg m^2, limit 1e-12\n"
            "  last accepted state: out/run.h5\n"
            "  hint:     massless tip body?\n");
}

}  // namespace
}  // namespace cardan
