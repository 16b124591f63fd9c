#include "scripts/report/report.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <regex>
#include <sstream>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/json.hpp"
#include "core/io/recorder.hpp"
#include "tests/report/example_run.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

std::string scratch(const std::string& name) { return testing::TempDir() + "cardan_report_" + name; }

std::string content(const std::string& path) {
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

std::string report_of(int rows, bool finished = true) {
  const std::string h5 = scratch("run.h5"), html = scratch("report.html");
  write_example_run(h5, rows, finished);
  write_report(h5, html);
  return content(html);
}

Json data_of(const std::string& html) {
  const std::string start = "<script type=\"application/json\" id=\"run\">";
  const auto from = html.find(start) + start.size();
  return Json::parse(html.substr(from, html.find("</script>", from) - from));
}

TEST(Report, StandsAlone) {
  const std::string html = report_of(2000);
  EXPECT_EQ(html.find("http:"), std::string::npos);
  EXPECT_EQ(html.find("https:"), std::string::npos);
  EXPECT_FALSE(std::regex_search(html, std::regex("(src|href)=\"[^#]|@import|url\\((?!data:)")));
  EXPECT_NE(html.find("Leon Sorokin"), std::string::npos) << "the licence of uPlot";
}

TEST(Report, ShowsTheNumbersOfAShortRunAsTheyAre) {
  const Json data = data_of(report_of(50));
  EXPECT_EQ(data["series"]["stretch"], 1);
  ASSERT_EQ(data["series"]["t"].size(), 50u);
  const auto recorded = Hdf5File::open(scratch("run.h5")).read_doubles("/channels/bodies/bus/rate");
  const Json& rate = data["series"]["channels"][1];
  EXPECT_EQ(rate["path"], "bodies/bus/rate");
  EXPECT_EQ(rate["components"][2], "z");
  for (std::size_t i = 0; i < 50; ++i)  // 5 digits
    EXPECT_NEAR(rate["values"][2][i].get<double>(), recorded.values[3 * i + 2],
                1e-4 * std::abs(recorded.values[3 * i + 2]));
}

// A variation of 1 m on an orbit's 7000 km must not be rounded away.
TEST(Report, KeepsSmallVariationsOnLargeValues) {
  const Json data = data_of(report_of(50));
  const Json& distance = data["series"]["channels"][2]["values"][1];
  const auto recorded = Hdf5File::open(scratch("run.h5")).read_doubles("/channels/bodies/bus/pose");
  for (std::size_t i = 0; i < 50; ++i) EXPECT_NEAR(distance[i].get<double>(), recorded.values[2 * i + 1], 1e-4);
}

TEST(Report, ThinsLongSeriesWithoutLosingExtremes) {
  const std::string html = report_of(60000);
  EXPECT_LT(html.size(), 3'000'000u);
  const Json data = data_of(html);
  EXPECT_GT(data["series"]["stretch"].get<int>(), 1);
  const auto recorded = Hdf5File::open(scratch("run.h5")).read_doubles("/channels/modes/wing_left");
  const Json& modes = data["series"]["channels"][6]["values"];
  for (std::size_t k = 0; k < 6; ++k) {
    ASSERT_EQ(modes[k].size(), data["series"]["t"].size());
    double low = 0, high = 0, shown_low = 0, shown_high = 0;
    for (std::size_t i = 0; i < 60000; ++i)
      low = std::min(low, recorded.values[6 * i + k]), high = std::max(high, recorded.values[6 * i + k]);
    for (double v : modes[k]) shown_low = std::min(shown_low, v), shown_high = std::max(shown_high, v);
    const double digits = 5e-5 * (high - low);  // 5 significant digits
    EXPECT_NEAR(shown_low, low, digits);
    EXPECT_NEAR(shown_high, high, digits);
  }
  const auto& t = data["series"]["t"];
  EXPECT_EQ(t.back().get<double>(), 240.0);
  for (std::size_t i = 1; i < t.size(); ++i) ASSERT_GE(t[i].get<double>(), t[i - 1].get<double>());
}

// A signal that decays passes through the smallest numbers there are.
TEST(Report, ShowsTheSmallestAndTheLargestNumbers) {
  const std::string h5 = scratch("extreme.h5"), html = scratch("extreme.html");
  const std::vector<double> values{5e-324, 1e-310, -2.2250738585072011e-308, std::numeric_limits<double>::max(),
                                   std::numeric_limits<double>::lowest(), HUGE_VAL, NAN, 0.0};
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin({}, {{"x", {"value"}, "m", "", "extremes"}});
  for (std::size_t i = 0; i < values.size(); ++i) recorder->row(static_cast<double>(i), std::span(&values[i], 1));
  recorder->close();
  write_report(h5, html);
  const Json shown = data_of(content(html))["series"]["channels"][0]["values"][0];
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i]))
      EXPECT_TRUE(shown[i].is_null());
    else  // 5 digits, or as many as a number below 2.2e-308 has
      EXPECT_NEAR(shown[i].get<double>(), values[i], std::max(1e-4 * std::abs(values[i]), 5e-324)) << i;
  }
}

TEST(Report, TellsWhenResultsOrPageCannotBeUsed) {
  write_example_run(scratch("run.h5"), 5);
  EXPECT_THROW(write_report(scratch("run.h5"), "/nowhere/report.html"), InputError);
  EXPECT_THROW(write_report("/nowhere/run.h5", scratch("report.html")), InputError);
}

/// The page after its scripts have run in a browser without a window.
std::string shown_in_browser(const std::string& html_path) {
  const std::string profile = scratch("profile"), dom = scratch("dom.html");
  fs::remove_all(profile);
  const std::string command =
      "timeout 120 chromium --headless --no-sandbox --disable-gpu --disable-quic --no-first-run "
      "--disable-background-networking --disable-component-update --disable-sync --user-data-dir=" +
      profile + " --window-size=1400,2000 --virtual-time-budget=10000 --dump-dom 'file://" + html_path +
      "#selftest' > " + dom + " 2> /dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  fs::remove_all(profile);
  return content(dom);
}

std::string captured(const std::string& text, const std::string& pattern) {
  std::smatch found;
  return std::regex_search(text, found, std::regex(pattern)) ? found[1].str() : "nothing";
}

class ReportInBrowser : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v chromium > /dev/null") != 0) GTEST_SKIP() << "chromium is not installed";
  }
};

TEST_F(ReportInBrowser, DrawsEverySeriesOfEveryPlot) {
  report_of(5000);
  const std::string dom = shown_in_browser(scratch("report.html"));
  EXPECT_EQ(captured(dom, "data-plots=\"(\\d+)\""), "13");  // 12 channels, one of them with two units
  EXPECT_EQ(captured(dom, "data-drawn=\"(\\d+)\""), "13");
  const std::regex ink("data-ink=\"([^\"]*)\"");
  int series = 0;
  for (std::sregex_iterator it(dom.begin(), dom.end(), ink), end; it != end; ++it) {
    std::istringstream counts((*it)[1].str());
    for (int n = 0; counts >> n; ++series) EXPECT_GT(n, 10) << "hundreds of pixels, less where others lie on top";
  }
  EXPECT_EQ(series, 4 + 3 + 2 + 4 + 4 + 2 + 6 + 6 + 3 + 3 + 3 + 2);
  EXPECT_NE(dom.find("all 3 checks passed"), std::string::npos);
  EXPECT_NE(dom.find("&lt;/script&gt;"), std::string::npos) << "names are shown as text";
  EXPECT_EQ(dom.find("<b>name</b>"), std::string::npos) << "names are not read as markup";
  const auto place = [&](const char* id) { return dom.find(std::string("id=\"group-") + id + "\""); };
  EXPECT_LT(place("pointing"), place("bodies"));
  EXPECT_LT(place("bodies"), place("wheels"));
  EXPECT_LT(place("ledger"), place("control"));
  EXPECT_LT(place("control"), place("other"));
}

TEST_F(ReportInBrowser, ShowsARunThatDidNotFinish) {
  for (const int rows : {300, 0}) {
    report_of(rows, false);
    const std::string dom = shown_in_browser(scratch("report.html"));
    EXPECT_EQ(captured(dom, "data-drawn=\"(\\d+)\""), "13") << rows << " rows";
    EXPECT_NE(dom.find("not finished"), std::string::npos);
    EXPECT_NE(dom.find("The run wrote no summary"), std::string::npos);
  }
}

}  // namespace
}  // namespace cardan
