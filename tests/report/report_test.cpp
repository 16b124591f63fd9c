#include "scripts/report/report.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <regex>
#include <sstream>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/json.hpp"
#include "core/io/recorder.hpp"
#include "tests/report/example_run.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

using test::scratch;

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

// 4000 bodies with two channels each, and three of another group: the page stays small, and nobody's channels vanish as a whole.
TEST(Report, OfThousandsOfChannelsShowsSomeOfEachGroup) {
  const std::string h5 = scratch("many.h5"), html = scratch("many.html");
  {
    RunHeader header;
    for (int i = 0; i < 20000; ++i) header.effective_parameters.emplace_back("bodies.b" + std::to_string(i) + ".mass", "1 kg");
    header.inputs = {{"vehicle.yaml", "", ""}};
    for (int i = 0; i < 20000; ++i) header.inputs[0].text += "  b" + std::to_string(i) + ": {mass: 1 kg}\n";
    std::vector<Channel> channels;
    for (int i = 0; i < 8000; ++i)
      channels.push_back({"bodies/b" + std::to_string(i), {"x", "y", "z"}, "rad/s", "body", "angular velocity of a body of many"});
    for (const char* name : {"a", "b", "c"}) channels.push_back({std::string("control/") + name, {"u"}, "N m", "", "a command"});
    const auto recorder = make_hdf5_recorder(h5);
    recorder->begin(header, channels);
    for (int row = 0; row < 11; ++row) {
      std::vector<double> values(3 * 8000 + 3);
      for (std::size_t k = 0; k < values.size(); ++k) values[k] = std::sin(0.1 * row + 1e-3 * static_cast<double>(k));
      recorder->row(row, values);
    }
    recorder->close();
  }
  write_report(h5, html);
  EXPECT_LT(fs::file_size(html), 3'000'000u);
  const Json data = data_of(content(html)), &left_out = data["series"]["left_out"];
  std::map<std::string, int> shown;
  for (const Json& c : data["series"]["channels"]) ++shown[c["path"].get<std::string>().substr(0, 4)];
  EXPECT_EQ(shown["cont"], 3);
  EXPECT_GT(shown["bodi"], 1000) << "what there is room for";
  EXPECT_EQ(left_out, Json({{"bodies", {{"shown", shown["bodi"]}, {"channels", 8000}}}}));
  EXPECT_EQ(data["series"]["channels"][0]["path"], "bodies/b0") << "the first ones";
  EXPECT_EQ(data["parameters"].back()[0], "...");
  EXPECT_NE(data["spec"].get<std::string>().find("/spec/files"), std::string::npos);
  fs::remove(h5);
}

/// What node prints of an expression with the functions of format.mjs.
std::string in_node(const std::string& expression) {
  const std::string program = scratch("format.mjs"), out = scratch("format.txt");
  std::ofstream(program) << "import { tickTexts, shareOfLimit } from '" CARDAN_SOURCE_DIR "/scripts/report/format.mjs';\n"
                         << "console.log(JSON.stringify(" << expression << "));\n";
  EXPECT_EQ(std::system(("node " + program + " > " + out).c_str()), 0);
  std::string text = content(out);
  text.erase(text.find_last_not_of('\n') + 1);
  return text;
}

TEST(ReportFormat, MarksOfAnAxisAreToldInFull) {
  EXPECT_EQ(in_node("tickTexts([0, 0.25, 0.5, 0.75, 1], 0.25)"), R"(["0","0.25","0.50","0.75","1.00"])");
  EXPECT_EQ(in_node("tickTexts([0.00075, 0.001, 0.00125], 0.00025)"), R"(["0.00075","0.00100","0.00125"])");
  EXPECT_EQ(in_node("tickTexts([-7.5e-4, -5e-4, 0], 2.5e-4)"), R"(["-7.5e-4","-5e-4","0"])");
  EXPECT_EQ(in_node("tickTexts([0, 50, 100], 50)"), R"(["0","50","100"])");
  EXPECT_EQ(in_node("tickTexts([0, 250000, 500000], 250000)"), R"(["0","2.5e5","5e5"])");
  EXPECT_EQ(in_node("tickTexts([7000000, 7000000.25], 0.25)"), R"(["7e6","7.00000025e6"])");
  EXPECT_EQ(in_node("tickTexts([0.1 + 0.2, -5.6e-17], 0.1)"), R"(["0.3","0"])");
  // Every step that the plots choose, at every size: the text is the number.
  EXPECT_EQ(in_node("[1, 2, 2.5, 5].flatMap((m) => [...Array(30).keys()].flatMap((n) => {"
                    "  const step = m * 10 ** (n - 15), marks = [-3, -1, 0, 1, 2, 7, 40].map((k) => k * step);"
                    "  return tickTexts(marks, step).filter((text, i) => Math.abs(Number(text) - marks[i]) > 1e-9 * step); }))"),
            "[]");
}

TEST(ReportFormat, SharesOfALimitAreBelowOneWhereACheckPasses) {
  EXPECT_EQ(in_node("shareOfLimit({value: 1.8, most: 2})"), "0.9");
  EXPECT_EQ(in_node("shareOfLimit({value: -9, most: 2})"), "0") << "below zero nothing is used";
  EXPECT_EQ(in_node("shareOfLimit({value: 100, least: 3})"), "0.03");
  EXPECT_EQ(in_node("shareOfLimit({value: 2, least: 3})"), "1.5");
  EXPECT_EQ(in_node("shareOfLimit({value: -7, most: -5}) - 5 / 7"), "0");
  EXPECT_EQ(in_node("shareOfLimit({value: -4, most: -5})"), "1.25");
  EXPECT_EQ(in_node("shareOfLimit({value: -1, least: -4})"), "0.25");
  EXPECT_EQ(in_node("Math.round(1e6 * shareOfLimit({value: 90.001, least: 89.9, most: 90.1}))"), "10000");
  EXPECT_EQ(in_node("shareOfLimit({value: -1, least: -2, most: 2})"), "0.5");
  EXPECT_EQ(in_node("shareOfLimit({value: 5, least: 5, most: 5})"), "0");
  EXPECT_EQ(in_node("shareOfLimit({value: 5.1, least: 5, most: 5}) > 1"), "true");
  EXPECT_EQ(in_node("shareOfLimit({value: -1, most: 0})"), "null") << "no scale";
  EXPECT_EQ(in_node("shareOfLimit({value: 1, limit: 2, detail: 'below 2 deg'})"), "0.5") << "of an older version";
  EXPECT_EQ(in_node("shareOfLimit({value: 100, limit: 3, detail: 'above 3'})"), "0.03");
  EXPECT_EQ(in_node("shareOfLimit({value: 1, limit: 2, detail: 'within 1 ... 2'})"), "null");
}

TEST(Report, TellsWhenResultsOrPageCannotBeUsed) {
  write_example_run(scratch("run.h5"), 5);
  EXPECT_THROW(write_report(scratch("run.h5"), "/nowhere/report.html"), InputError);
  EXPECT_THROW(write_report("/nowhere/run.h5", scratch("report.html")), InputError);
}

/// The answer to the results of a run with a change: the title of the error, or "page".
template <class Change>
std::string answer(const Change& change) {
  const std::string h5 = scratch("changed.h5");
  write_example_run(h5, 20);
  Hdf5File file = Hdf5File::update(h5);
  change(file);
  file.close();
  try {
    write_report(h5, scratch("changed.html"));
  } catch (const InputError& e) {
    return std::string(number_of(e.diagnostics().at(0).code)) + " " + e.diagnostics().at(0).at.key_path;
  }
  return "page";
}

// Nothing in the file is taken for granted.
TEST(Report, IsRefusedForResultsThatDoNotFit) {
  const std::string channel = "/channels/bodies/bus/rate";
  const auto written = [&](const std::string& path, const std::vector<std::size_t>& shape) {
    return answer([&](Hdf5File& file) {
      std::size_t n = 1;
      for (std::size_t k : shape) n *= k;
      const auto unit = file.has_attribute(path, "components") ? file.texts_attribute(path, "components") : std::vector<std::string>{};
      file.write(path, std::vector<double>(n, 0.5), shape);
      if (unit.empty()) return;
      file.set_attribute(path, "components", unit);
      for (const char* name : {"unit", "frame", "meaning"}) file.set_attribute(path, name, std::string("x"));
    });
  };
  EXPECT_EQ(answer([](Hdf5File&) {}), "page");
  EXPECT_EQ(written(channel, {20, 3}), "page");
  EXPECT_EQ(written(channel, {3, 3}), "page") << "as a killed run may leave it";
  for (const std::vector<std::size_t>& shape : {std::vector<std::size_t>{}, {20}, {20, 2}, {20, 4}, {20, 3, 1}, {0}, {20, 0}})
    EXPECT_EQ(written(channel, shape), "C0702 " + channel) << shape.size();
  for (const std::vector<std::size_t>& shape : {std::vector<std::size_t>{}, {20, 1}}) EXPECT_EQ(written("/time", shape), "C0702 /time");
  EXPECT_EQ(answer([&](Hdf5File& file) { file.set_attribute(channel, "components", std::vector<std::string>(1000, "x")); }),
            "C0702 " + channel);
  for (const char* name : {"components", "unit", "frame", "meaning"})
    EXPECT_EQ(answer([&](Hdf5File& file) { file.remove_attribute(channel, name); }), "C0702 " + channel) << name;
  EXPECT_EQ(answer([&](Hdf5File& file) { file.set_attribute(channel, "unit", 1.0); }), "C0702 " + channel + "@unit");
  for (const char* path : {"/time", "/channels", "/spec/files", "/spec/parameters", "/run/inputs"})
    EXPECT_EQ(answer([&](Hdf5File& file) { file.remove(path); }), std::string("C0702 ") + path);
  EXPECT_EQ(written("/spec/parameters", {4, 2}), "C0702 /spec/parameters");
  EXPECT_EQ(answer([&](Hdf5File& file) { file.write("/run/inputs", std::vector<std::string>{"a", "b", "c"}, {3}); }), "C0702 /run/inputs");
  for (const char* name : {"scenario", "title", "seed", "started"})
    EXPECT_EQ(answer([&](Hdf5File& file) { file.remove_attribute("/run", name); }), "page") << name;
  for (const char* text : {"", "{", "[]", "3", "{\"checks\": 3}", "{\"checks\": [3]}", "{\"checks\": [{\"value\": 1}]}",
                           "{\"checks\": [{\"name\": 1}]}", "{\"ledger\": []}", "{\"figures\": {}}", "{\"wall_s\": 1e999}"})
    EXPECT_EQ(answer([&](Hdf5File& file) { file.write("/attachments/summary", std::string(text)); }), "C0702 /attachments/summary") << text;
  EXPECT_EQ(answer([&](Hdf5File& file) { file.write("/attachments/summary", std::string("{\"wall_s\": null, \"new\": [1]}")); }), "page");
  EXPECT_EQ(answer([&](Hdf5File& file) { file.write("/attachments/summary", 1.0); }), "C0702 /attachments/summary");
}

TEST(Report, IsRefusedForWhatIsNoFile) {
  for (const char* path : {"/dev/zero", "/", "/dev/null"}) EXPECT_THROW(write_report(path, scratch("none.html")), InputError) << path;
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
  EXPECT_EQ(captured(dom, "data-share=\"([^\"]*)\""), "0.310000") << "0.0031 of 0.01";
  EXPECT_NE(dom.find("<h2>Figures</h2>"), std::string::npos);
  EXPECT_NE(dom.find("<td>thr_a error</td>"), std::string::npos) << "names as they were given";
  EXPECT_NE(dom.find("wing_left</b>"), std::string::npos);
  EXPECT_NE(dom.find("2 warnings</span>"), std::string::npos);
  EXPECT_NE(dom.find("<td class=\"warning\">W0301</td><td>eta 1 reaches 0.3 m, 5 % of its length &lt;b&gt;<small>bodies.wing_left, vehicle.yaml:12</small></td>"
                     "<td>level: 2</td>"),
            std::string::npos);
  EXPECT_NE(dom.find("before the run"), std::string::npos);
  EXPECT_NE(dom.find("balances do not close"), std::string::npos);
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
