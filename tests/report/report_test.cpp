#include "scripts/report/report.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
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
#include "scripts/report/differences.hpp"
#include "scripts/report/figure.hpp"
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

/// A channel of the page by its path.
Json channel_of(const Json& data, const std::string& path) {
  for (const Json& c : data["series"]["channels"])
    if (c["path"] == path) return c;
  ADD_FAILURE() << path << " is not drawn";
  return {};
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
  const Json rate = channel_of(data, "bodies/bus/rate");
  EXPECT_EQ(rate["components"][2], "z");
  for (std::size_t i = 0; i < 50; ++i)  // 5 digits
    EXPECT_NEAR(rate["values"][2][i].get<double>(), recorded.values[3 * i + 2], 1e-4 * std::abs(recorded.values[3 * i + 2]));
}

// A variation of 1 m on an orbit's 7000 km must not be rounded away.
TEST(Report, KeepsSmallVariationsOnLargeValues) {
  const Json data = data_of(report_of(50));
  const Json distance = channel_of(data, "bodies/bus/pose")["values"][1];
  const auto recorded = Hdf5File::open(scratch("run.h5")).read_doubles("/channels/bodies/bus/pose");
  for (std::size_t i = 0; i < 50; ++i) EXPECT_NEAR(distance[i].get<double>(), recorded.values[2 * i + 1], 1e-4);
}

TEST(Report, ThinsLongSeriesWithoutLosingExtremes) {
  const std::string html = report_of(60000);
  EXPECT_LT(html.size(), 3'000'000u);
  const Json data = data_of(html);
  EXPECT_GT(data["series"]["stretch"].get<int>(), 1);
  const auto recorded = Hdf5File::open(scratch("run.h5")).read_doubles("/channels/modes/wing_left");
  const Json modes = channel_of(data, "modes/wing_left")["values"];
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
  const std::vector<double> values{
      5e-324, 1e-310, -2.2250738585072011e-308, std::numeric_limits<double>::max(), std::numeric_limits<double>::lowest(), HUGE_VAL,
      NAN,    0.0};
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

/// Reading grows with the channels, not with their square: a thousand attitudes were beyond what the reader may take.
TEST(Report, TakesAThousandAttitudes) {
  constexpr std::size_t kBodies = 1000;
  const std::string h5 = scratch("many.h5"), html = scratch("many.html");
  std::vector<Channel> channels;
  for (std::size_t i = 0; i < kBodies; ++i)
    channels.push_back({fmt::format("bodies/b{}/attitude", i), {"w", "x", "y", "z"}, "1", "world", "body to world"});
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin({}, channels);
  for (const double t : {0.0, 1.0}) {
    std::vector<double> row;
    for (std::size_t i = 0; i < kBodies; ++i) row.insert(row.end(), {std::cos(t), 0.0, 0.0, std::sin(t)});
    recorder->row(t, row);
  }
  recorder->close();
  write_report(h5, html);
  EXPECT_EQ(channel_of(data_of(content(html)), "bodies/b0/attitude angles")["components"].size(), 4U);
}

/// The numbers of the figure of one channel: of each piece of the line, x and y in turn.
std::vector<std::vector<double>> line_of_figure(const std::vector<double>& values) {
  const std::string h5 = scratch("figure.h5"), svg = scratch("figure.svg");
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin({}, {{"x", {"value"}, "m", "", "some numbers"}});
  for (std::size_t i = 0; i < values.size(); ++i) recorder->row(static_cast<double>(i), std::span(&values[i], 1));
  recorder->close();
  write_figure(h5, svg, {"x"});
  const std::string text = content(svg);
  EXPECT_EQ(text.find("nan"), std::string::npos) << text;
  EXPECT_EQ(text.find("inf"), std::string::npos) << text;
  std::smatch path;
  EXPECT_TRUE(std::regex_search(text, path, std::regex("d=\"([^\"]*)\" fill=\"none\"")));
  std::vector<std::vector<double>> pieces;
  const std::string d = path[1];
  const std::regex number("([ML ])([-0-9.e]+)");
  for (std::sregex_iterator i(d.begin(), d.end(), number), end; i != end; ++i) {
    if ((*i)[1] == "M") pieces.emplace_back();
    pieces.back().push_back(std::stod((*i)[2]));
  }
  return pieces;
}

TEST(Figure, LeavesGapsWhereNothingCanBeDrawn) {
  const auto pieces = line_of_figure({0.0, 1.0, NAN, 2.0, 4.0, HUGE_VAL, 1e305, 3.0});
  ASSERT_EQ(pieces.size(), 3u);
  ASSERT_EQ(pieces[1].size(), 4u);
  EXPECT_GT(pieces[0][1] - pieces[0][3], 0.0) << "up is less y";
  // A tenth of a point, to which numbers are rounded, twice.
  EXPECT_NEAR(pieces[1][1] - pieces[1][3], 2 * (pieces[0][1] - pieces[0][3]), 0.3);
}

TEST(Figure, TellsEachUnitOfAPanel) {
  const std::string h5 = scratch("units.h5"), svg = scratch("units.svg");
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin({}, {{"x", {"rate", "place", "more", "share"}, "m/s m m 1", "", "some numbers"}});
  for (const double t : {0.0, 1.0}) recorder->row(t, std::array{t, t, t, t});
  recorder->close();
  write_figure(h5, svg, {"x"});
  EXPECT_NE(content(svg).find(">m/s, m, 1</text>"), std::string::npos) << content(svg);
}

TEST(Figure, IsFlatWhereNothingMovesAndKeepsPeaksOfLongRuns) {
  for (const double level : {0.0, 1.0, 6.9e6, 1e-310}) {
    const auto flat = line_of_figure({level, level, level + 1e-12 * level});
    ASSERT_EQ(flat.size(), 1u) << level;
    ASSERT_EQ(flat[0].size(), 4u) << level;
    EXPECT_EQ(flat[0][1], flat[0][3]) << level;
  }
  std::vector<double> peak(20000, 0.0);
  peak[12345] = 1.0;
  const auto pieces = line_of_figure(peak);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_LT(pieces[0].size(), 12u) << "four corners, and the ends";
  double least = pieces[0][1], x = 0.0;
  for (std::size_t i = 1; i < pieces[0].size(); i += 2)
    if (pieces[0][i] < least) least = pieces[0][i], x = pieces[0][i - 1];
  EXPECT_LT(least, pieces[0][1] - 100.0) << "of 150";
  const double share = (x - pieces[0][0]) / (pieces[0][pieces[0].size() - 2] - pieces[0][0]);
  EXPECT_NEAR(share, 12345.0 / 19999.0, 1e-3);  // a tenth of a point of 632
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

TEST(Report, HasTheAnglesOfAnAttitude) {
  const Json channels = data_of(report_of(500))["series"]["channels"];
  ASSERT_EQ(channels[0]["path"], "bodies/bus/attitude");
  const Json& angles = channels[1];
  EXPECT_EQ(angles["path"], "bodies/bus/attitude angles");
  EXPECT_EQ(angles["unit"], "deg");
  EXPECT_EQ(angles["components"], Json({"turn", "yaw", "pitch", "roll"}));
  EXPECT_NE(angles["meaning"].get<std::string>().find("about z, then the new y, then the new x"), std::string::npos) << "the convention";
  EXPECT_EQ(angles["values"][0][0], 0.0);
  const double axis = std::sqrt(0.27 * 0.27 + 0.53 * 0.53 + 0.8 * 0.8);  // of the example, not quite 1
  EXPECT_NEAR(angles["values"][0].back().get<double>(), 2 * std::atan(axis * std::tan(0.5236 / 2)) * 180 / M_PI, 1e-3) << "of the slew";
}

TEST(Report, HasTheAnglesOfAnAttitudeFromItsCommand) {
  const std::string h5 = scratch("run.h5"), html = scratch("report.html");
  const std::vector<std::string> wxyz{"w", "x", "y", "z"};
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin({}, {{"bodies/bus/attitude", wxyz, "1", "world", ""}, {"pointing/wanted", wxyz, "1", "", "", "bodies/bus/attitude"}});
  for (int i = 0; i < 3; ++i)  // 10 deg about z per row, wanted; 1 deg per row more
    recorder->row(i, std::vector<double>{std::cos(0.5 * 11 * i * M_PI / 180), 0, 0, std::sin(0.5 * 11 * i * M_PI / 180),
                                         std::cos(0.5 * 10 * i * M_PI / 180), 0, 0, std::sin(0.5 * 10 * i * M_PI / 180)});
  recorder->close();
  write_report(h5, html);
  const Json angles = channel_of(data_of(content(html)), "bodies/bus/attitude off command");
  EXPECT_NE(angles["meaning"].get<std::string>().find("from the commanded attitude pointing/wanted"), std::string::npos);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(angles["values"][1][static_cast<std::size_t>(i)].get<double>(), i, 1e-6) << "yaw";
}

// Rest, rounding beside it and a row that is not a number: what does not move is not drawn, and named with its value.
TEST(Report, LeavesOutWhatDoesNotMoveAndListsIt) {
  const std::string h5 = scratch("still.h5"), html = scratch("still.html");
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin({}, {{"hinges/a/angle", {"angle"}, "rad", "", "moves"},
                       {"hinges/b/angle", {"angle"}, "rad", "", "rounding"},
                       {"hinges/c/rate", {"x", "y"}, "rad/s", "", "rest"},
                       {"hinges/d/rate", {"x", "y"}, "rad/s", "", "one of them moves"},
                       {"hinges/e/rate", {"x"}, "rad/s", "", "one is not a number"},
                       {"hinges/f/rate", {"x"}, "rad/s", "", "none is a number"},
                       {"ledger/energy", {"residual"}, "1", "", "small"},
                       {"ledger/work", {"residual"}, "1", "", "large"}});
  for (int i = 0; i < 30; ++i) {
    const double x = std::sin(0.3 * i);
    recorder->row(i, std::vector<double>{x, 0.5 + 1e-15 * x, 0.25, -0.125, 1.0, x, i == 3 ? NAN : 1.0, NAN, 1e-17 * x, 1.0});
  }
  recorder->close();
  write_report(h5, html);
  const Json data = data_of(content(html))["series"];
  std::vector<std::string> drawn;
  for (const Json& c : data["channels"]) drawn.push_back(c["path"]);
  EXPECT_EQ(drawn, (std::vector<std::string>{"hinges/a/angle", "hinges/d/rate", "hinges/e/rate", "ledger/energy"}));
  const Json& still = data["still"]["hinges"];
  ASSERT_EQ(still.size(), 3u);
  EXPECT_EQ(still[0]["path"], "hinges/b/angle");
  EXPECT_NEAR(still[0]["values"][0].get<double>(), 0.5, 1e-9);
  EXPECT_EQ(still[1]["values"], Json({0.25, -0.125}));
  EXPECT_TRUE(still[2]["values"][0].is_null());
  EXPECT_EQ(data["still"]["ledger"][0]["values"], Json({1.0}));
  EXPECT_EQ(data["still_left_out"], 0);
}

TEST(Report, OfOneRowListsItsValues) {
  const Json data = data_of(report_of(1))["series"];
  EXPECT_TRUE(data["channels"].empty());
  EXPECT_EQ(data["still"]["bodies"].size(), 3u);
}

TEST(Report, OfThousandsOfChannelsThatDoNotMoveStaysSmall) {
  const std::string h5 = scratch("rest.h5"), html = scratch("rest.html");
  std::vector<Channel> channels;
  for (int i = 0; i < 8000; ++i)
    channels.push_back({"bodies/b" + std::to_string(i) + "/rate", {"x", "y", "z"}, "rad/s", "body", "at rest"});
  RunHeader header;
  header.most_rows = 4;
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin(header, channels);
  for (int i = 0; i < 4; ++i) recorder->row(i, std::vector<double>(24000, 1.0));
  recorder->close();
  write_report(h5, html);
  EXPECT_LT(fs::file_size(html), 400'000u);
  const Json data = data_of(content(html))["series"];
  EXPECT_EQ(data["still"]["bodies"].size() + data["still_left_out"].get<std::size_t>(), 8000u);
  fs::remove(h5);
}

TEST(Report, TellsWhatHappened) {
  const Json notes = data_of(report_of(200))["notes"];
  EXPECT_EQ(notes["phases"], Json::parse(R"([[0.0, "slew"], [90.0, "settle"]])"));
  EXPECT_EQ(notes["events"], Json::parse(R"([[45.0, "half way", "rising"]])"));
  EXPECT_EQ(notes["printed"][0], Json::parse(R"([null, "a line of the script <b>", "the scenario"])"));
  EXPECT_EQ(notes["warnings"][0][1], "W0301");
  EXPECT_EQ(notes["left_out"], Json::object());
}

TEST(Report, HasTheHistoryOfSteps) {
  const Json few = data_of(report_of(200))["steps"];
  ASSERT_EQ(few["t"].size(), 200u);
  EXPECT_EQ(few["t"].back(), 240.0);
  EXPECT_EQ(few["shortest"][7], 2e-3);
  EXPECT_EQ(few["longest"][7], 0.03);
  EXPECT_EQ(few["order"][6], 5.6);
  EXPECT_EQ(few["rejected"][5], 2.0);
  const Json many = data_of(report_of(1700))["steps"];  // four together
  ASSERT_EQ(many["t"].size(), 425u);
  EXPECT_EQ(many["t"].back(), 240.0);
  EXPECT_EQ(many["longest"][0], 0.04);
  EXPECT_EQ(many["rejected"][0], 3.0) << "0, 1, 2, 0";
}

TEST(Report, BoundsWhatHappened) {
  const std::string h5 = scratch("chatty.h5"), html = scratch("chatty.html");
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin({}, {{"x", {"x"}, "m", "", ""}});
  for (int i = 0; i < 20'000; ++i) recorder->note(Note::printed, i, {"a line that a controller prints at each of its ticks", "controller"});
  recorder->close();
  write_report(h5, html);
  EXPECT_LT(fs::file_size(html), 300'000u);
  const Json notes = data_of(content(html))["notes"];
  EXPECT_GT(notes["printed"].size(), 500u);
  EXPECT_EQ(static_cast<double>(notes["printed"].size()) + notes["left_out"]["printed"].get<double>(), 20'000.0);
}

TEST(Report, HasTheShapesOfModes) {
  const Json shapes = data_of(report_of(20))["mode_shapes"];
  ASSERT_EQ(shapes["pictures"].size(), 2u);
  const Json& strip = shapes["pictures"][0];
  EXPECT_EQ(strip["bodies"], Json({"wing_left", "wing_right"}));
  EXPECT_EQ(strip["size"], 4.0);
  EXPECT_EQ(strip["frequency"], Json({0.31, 1.9}));
  EXPECT_EQ(strip["points"][0], -500) << "about the middle, in thousandths of the size";
  EXPECT_EQ(strip["points"].size(), 30u);
  EXPECT_EQ(strip["shapes"][0].back(), 1000) << "the tip moves most";
  EXPECT_EQ(shapes["modes_left_out"], 0);
}

// A mesh finer than any that is recorded: as many modes as there is room for.
TEST(Report, BoundsTheShapesOfModes) {
  const std::string h5 = scratch("fine.h5"), html = scratch("fine.html");
  RunHeader header;
  header.mode_pictures = {
      {{"a"}, "", std::vector<double>(30, 1.0), std::vector<double>(3 * 2000), {}, std::vector<double>(30 * 3 * 2000, 0.5)},
      {{"b"}, "", std::vector<double>(30, 1.0), std::vector<double>(3 * 2000), {}, std::vector<double>(30 * 3 * 2000, 0.5)}};
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin(header, {{"x", {"x"}, "m", "", ""}});
  recorder->close();
  write_report(h5, html);
  EXPECT_LT(fs::file_size(html), 600'000u);
  const Json shapes = data_of(content(html))["mode_shapes"];
  EXPECT_EQ(shapes["pictures"].size(), 1u);
  EXPECT_EQ(shapes["pictures"][0]["shapes"].size() + shapes["modes_left_out"].get<std::size_t>(), 30u);
  EXPECT_EQ(shapes["left_out"], Json({"b"}));
}

/// What node prints of an expression with the functions of format.mjs and happenings.mjs.
std::string in_node(const std::string& expression) {
  const std::string program = scratch("format.mjs"), out = scratch("format.txt");
  std::ofstream(program) << "import { tickTexts, shareOfLimit } from '" CARDAN_SOURCE_DIR "/scripts/report/format.mjs';\n"
                         << "import * as happenings from '" CARDAN_SOURCE_DIR "/scripts/report/happenings.mjs';\n"
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

TEST(ReportHappenings, SayHowARunEnded) {
  const auto ending = [](const std::string& summary) { return in_node("happenings.ending({run: {}, last: 3, summary: " + summary + "})"); };
  EXPECT_EQ(ending("{verdict: 'passed', simulated_s: 4, planned_s: 4, ended_by: 'the planned end'}"),
            R"("Reached its planned end at t = 4 s.")");
  EXPECT_EQ(ending("{verdict: 'failed', simulated_s: 1.5, planned_s: 4, ended_by: 'stop() in event \"x\"', checks: [{verdict: 'fail'}, "
                   "{verdict: 'pass'}]}"),
            R"("Ended at t = 1.5 s of 4 s by stop() in event \"x\"; a check failed.")");
  EXPECT_EQ(ending("{verdict: 'interrupted', simulated_s: 1, planned_s: 4, ended_by: 'SIGTERM'}"),
            R"("Interrupted at t = 1 s of 4 s by SIGTERM; checks were not worked out.")");
  EXPECT_EQ(ending("{verdict: 'aborted', simulated_s: 1, planned_s: 4, failure: {code: 'N0101', title: 'a title'}}"),
            R"("Ended at t = 1 s of 4 s by an error, N0101: a title; checks were not worked out.")");
  EXPECT_EQ(ending("null"), R"("Not finished: the run is still going on, or was killed. The last row that was saved is at t = 3 s.")");
  EXPECT_EQ(ending("{verdict: 'passed', simulated_s: 4}"), R"("Reached its planned end at t = 4 s.")") << "of an earlier version";
}

TEST(ReportHappenings, AreInOrderOfTime) {
  const std::string notes =
      "{phases: [[0, 'a'], [2, 'b'], [3, '']], events: [[2.5, 'e', 'rising']], printed: [[null, 'p', 's'], [2.5, 'q', 'c']], "
      "warnings: [[1, 'W1', 'w', 'k', 'f:1', 'h'], [null, 'W2', 'v', '', '', '']]}";
  EXPECT_EQ(in_node("happenings.bands(" + notes + ".phases, 9)"), R"([{"from":0,"to":2,"name":"a"},{"from":2,"to":3,"name":"b"}])");
  EXPECT_EQ(in_node("happenings.bands([[1, 'a']], 9)"), R"([{"from":1,"to":9,"name":"a"}])");
  EXPECT_EQ(in_node("happenings.instants(" + notes + ").map(({t, kind, text}) => [t, kind, text])"),
            R"([[1,"warning","W1: w"],[2.5,"event","event \"e\", rising"]])");
  EXPECT_EQ(in_node("happenings.story(" + notes + ").map(({t, text}) => [t, text])"),
            R"([[null,"W2: v"],[null,"p"],[0,"a"],[1,"W1: w"],[2,"b"],[2.5,"e"],[2.5,"q"],[3,"the last phase is over"]])");
  EXPECT_EQ(in_node("happenings.warningsOf(null, " + notes + ")[0]"),
            R"({"t":1,"code":"W1","about":"w","path":"k","place":"f:1","hint":"h"})");
}

TEST(ReportHappenings, NameTheAxisOfAMode) {
  EXPECT_EQ(in_node("happenings.axisOf([0, 0, 1, 0, 0, -5])"), R"("z")");
  EXPECT_EQ(in_node("happenings.axisOf([0, 1, 0, 0.05, -5, 0])"), R"("y")");
  EXPECT_EQ(in_node("happenings.axisOf([0, 1, 1])"), R"("")");
  EXPECT_EQ(in_node("happenings.axisOf([0, 0, 0])"), R"("")");
}

TEST(ReportHappenings, AreToldAtTheCursor) {
  const std::string marks =
      "{bands: [{from: 0, to: 2, name: 'a'}, {from: 2, to: 3, name: 'b'}], instants: [{t: 1, text: 'x'}, {t: 1.2, text: 'y'}]}";
  EXPECT_EQ(in_node("happenings.told(" + marks + ", 1.1, 0.15)"), R"(["phase \"a\"","1 s  x","1.2 s  y"])");
  EXPECT_EQ(in_node("happenings.told(" + marks + ", 2.5, 0.15)"), R"(["phase \"b\""])");
  EXPECT_EQ(in_node("happenings.told(" + marks + ", 4, 0.15)"), "[]");
  EXPECT_EQ(in_node("happenings.told({bands: [], instants: Array(9).fill({t: 1, text: 'x'})}, 1, 0).length"), "7");
}

TEST(ReportHappenings, GroupChannelsByBody) {
  EXPECT_EQ(in_node("happenings.groupsOf([{path: 'x'}, {path: 'hinges/a/angle'}, {path: 'own/y'}, {path: 'hinges/b/angle'}, {path: "
                    "'hinges/a/rate'}], "
                    "{hinges: [{path: 'hinges/b/rate'}]}, ['hinges']).map(({key, parts}) => [key, parts.map(({name, channels, still}) => "
                    "[name, channels.map((c) => c.name), still.map((c) => c.name)])])"),
            R"([["hinges",[["a",["angle","rate"],[]],["b",["angle"],["rate"]]]],["other",[["",["x"],[]]]],["own",[["",["y"],[]]]]])");
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
  EXPECT_EQ(answer([](Hdf5File& file) { file.remove("/run/events"); }), "page") << "of an earlier version";
  EXPECT_EQ(answer([](Hdf5File& file) { file.remove("/mode_shapes"); }), "page") << "of an earlier version";
  for (const char* path : {"/run/events/t", "/run/events/text", "/run/printed/left_out", "/mode_shapes/0/points", "/mode_shapes/0/lines",
                           "/mode_shapes/0/frequency", "/mode_shapes/0/shapes"}) {
    EXPECT_EQ(answer([&](Hdf5File& file) { file.remove(path); }), std::string("C0702 ") + path);
    EXPECT_EQ(written(path, {4, 4, 4, 4}), std::string("C0702 ") + path);
    EXPECT_EQ(answer([&](Hdf5File& file) { file.write(path, std::string("a text")); }), std::string("C0702 ") + path);
  }
  EXPECT_EQ(answer([](Hdf5File& file) { file.remove_attribute("/mode_shapes/0", "bodies"); }), "C0702 /mode_shapes/0");
  EXPECT_EQ(answer([](Hdf5File& file) {
              file.write("/mode_shapes/0/lines", std::vector<double>{0, 10}, {1, 2});
            }),
            "C0702 /mode_shapes/0/lines");
  EXPECT_EQ(answer([](Hdf5File& file) {
              file.write("/mode_shapes/0/lines", std::vector<double>{NAN, -1}, {1, 2});
            }),
            "C0702 /mode_shapes/0/lines");
  EXPECT_EQ(answer([](Hdf5File& file) {
              file.write("/mode_shapes/1/points", std::vector<double>(15, HUGE_VAL), {5, 3});
            }),
            "C0702 /mode_shapes/1/points");
  EXPECT_EQ(answer([](Hdf5File& file) { file.write("/mode_shapes/1/points", std::vector<double>(15, 1e308), {5, 3}); }), "page");
  EXPECT_EQ(answer([](Hdf5File& file) { file.write("/mode_shapes/other", 1.0); }), "C0702 /mode_shapes/other");
  EXPECT_EQ(answer([](Hdf5File& file) {
              file.write("/run/events/text", std::vector<std::string>{"a", "b", "c", "d"}, {4, 1});
            }),
            "C0702 /run/events/text");
  for (const double count : {-1.0, double(NAN), 1e300})
    EXPECT_EQ(answer([&](Hdf5File& file) { file.write("/run/printed/left_out", count); }), "C0702 /run/printed/left_out");
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
      profile + " --window-size=1400,2000 --virtual-time-budget=10000 --dump-dom 'file://" + html_path + "#selftest' > " + dom +
      " 2> /dev/null";
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

// What differs is drawn at once, the rest when it is opened; a NaN is a gap.
TEST_F(ReportInBrowser, DrawsTwoRunsOverEachOtherAndTheirDifference) {
  DifferencePart off;
  off.kind = "channel", off.name = "a/b x </script>", off.unit = "m", off.text = "off by 0.1 m", off.why = "a reason";
  for (int i = 0; i < 5000; ++i) {
    off.t.push_back(0.01 * i);
    off.reference.push_back(std::sin(off.t.back()));
    off.is.push_back(i == 77 ? std::nan("") : 1.1 * off.reference.back());
  }
  off.worst = Difference{0.1, 0.05, 1.57, 1.1, 1.0, false};
  off.pass = false;
  DifferencePart right = off;
  right.pass = true;
  DifferenceCase one;
  one.name = "one", one.truth = "the sine", one.pass = false, one.parts = {off, right};
  DifferenceCase two = one;
  two.name = "two", two.pass = true, two.parts = {right};
  const std::string html = scratch("differences.html");
  std::ofstream(html) << differences_page("Two", {"here"}, "run", "reference", {one, two});
  EXPECT_LT(fs::file_size(html), 400'000u);
  const std::string dom = shown_in_browser(html);
  EXPECT_EQ(captured(dom, "data-plots=\"(\\d+)\""), "2");
  EXPECT_EQ(captured(dom, "data-drawn=\"(\\d+)\""), "2");
  EXPECT_NE(dom.find("1 of 2 fail"), std::string::npos);
  EXPECT_NE(dom.find("1669 of 5000 rows"), std::string::npos);
}

TEST_F(ReportInBrowser, DrawsEverySeriesOfEveryPlot) {
  report_of(5000);
  const std::string dom = shown_in_browser(scratch("report.html"));
  EXPECT_EQ(captured(dom, "data-plots=\"(\\d+)\""),
            "15");  // 12 channels, one of them with two units, the angles of the attitude, the order of steps: their lengths do not move
  EXPECT_EQ(captured(dom, "data-drawn=\"(\\d+)\""), "15");
  EXPECT_EQ(captured(dom, "data-shapes=\"(\\d+)\""), "7") << "two modes as lines, five points of another";
  EXPECT_NE(dom.find("Reached its planned end at t = 240 s."), std::string::npos);
  EXPECT_NE(dom.find("<code>a line of the script &lt;b&gt;</code>"), std::string::npos);
  EXPECT_NE(dom.find("half way"), std::string::npos);
  const std::regex ink("data-ink=\"([^\"]*)\"");
  int series = 0;
  for (std::sregex_iterator it(dom.begin(), dom.end(), ink), end; it != end; ++it) {
    std::istringstream counts((*it)[1].str());
    for (int n = 0; counts >> n; ++series) EXPECT_GT(n, 10) << "hundreds of pixels, less where others lie on top";
  }
  EXPECT_EQ(series, 4 + 4 + 3 + 2 + 4 + 4 + 2 + 6 + 6 + 3 + 3 + 3 + 2 + 1);
  EXPECT_NE(dom.find("all 3 checks passed"), std::string::npos);
  EXPECT_NE(dom.find("&lt;/script&gt;"), std::string::npos) << "names are shown as text";
  EXPECT_EQ(dom.find("<b>name</b>"), std::string::npos) << "names are not read as markup";
  EXPECT_EQ(captured(dom, "data-share=\"([^\"]*)\""), "0.310000") << "0.0031 of 0.01";
  EXPECT_NE(dom.find("<h2>Figures</h2>"), std::string::npos);
  EXPECT_NE(dom.find("<td>thr_a error</td>"), std::string::npos) << "names as they were given";
  EXPECT_NE(dom.find("wing_left</b>"), std::string::npos);
  EXPECT_NE(dom.find("2 warnings</span>"), std::string::npos);
  EXPECT_NE(dom.find("<td class=\"warning\">W0301</td><td>eta 1 reaches 0.3 m, 5 % of its length &lt;b&gt;<small>bodies.wing_left, "
                     "vehicle.yaml:12</small></td>"
                     "<td>level: 2</td>"),
            std::string::npos);
  EXPECT_NE(dom.find("before the run"), std::string::npos);
  EXPECT_NE(dom.find("balances do not close"), std::string::npos);
  EXPECT_NE(dom.find("<td>cut at instants and events</td><td class=\"number\">211</td>"), std::string::npos);
  EXPECT_NE(dom.find("<td>of a given length</td><td class=\"number\">7</td>"), std::string::npos) << "48 218 steps in all";
  EXPECT_NE(dom.find("<td>error of modes</td><td class=\"number\">17</td>"), std::string::npos);
  EXPECT_NE(dom.find("<td>ticks</td><td class=\"number\">2 400</td>"), std::string::npos);
  EXPECT_NE(dom.find("<td>bus.&lt;b&gt;wx&lt;/b&gt;</td>"), std::string::npos);
  const auto place = [&](const char* id) { return dom.find(std::string("id=\"group-") + id + "\""); };
  EXPECT_LT(place("pointing"), place("bodies"));
  EXPECT_LT(place("bodies"), place("wheels"));
  EXPECT_LT(place("ledger"), place("control"));
  EXPECT_LT(place("control"), place("other"));
}

TEST(Report, IsTextWhateverTheTitleIs) {
  const std::string h5 = scratch("odd.h5"), html = scratch("odd.html");
  RunHeader header;
  header.title = "a\xff & <b>";
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin(header, {{"x", {"value"}, "W", "", "x"}});
  recorder->close();
  write_report(h5, html);
  EXPECT_NE(content(html).find("<title>a? &amp; &lt;b&gt;</title>"), std::string::npos);
}

// Rounding errors, a force that vanishes, and the least and largest numbers have axes that can be read; a long name stays on the page.
TEST_F(ReportInBrowser, TellsTheValuesAlongEveryAxis) {
  const std::string h5 = scratch("axes.h5"), html = scratch("axes.html");
  const std::vector<double> sizes{1e-12, 3e-17, 2e-22, 4e-300, 7.0, 1e12, 1e306};
  RunHeader header;
  header.title = std::string(400, 'm');
  std::vector<Channel> channels{{"nodes/wrench", {"moment", "force"}, "N*m N", "", "the moment is zero"}};
  for (std::size_t k = 0; k < sizes.size(); ++k)
    channels.push_back({(k ? "group_" + std::to_string(k) : "loops") + "/x", {"value"}, "W", "", "x"});
  const auto recorder = make_hdf5_recorder(h5);
  recorder->begin(header, channels);
  for (int i = 0; i < 50; ++i) {
    std::vector<double> row{0.0, std::sin(i)};
    for (double size : sizes) row.push_back(size * std::sin(i + 1.0));
    recorder->row(i, row);
  }
  recorder->close();
  write_report(h5, html);
  const std::string dom = shown_in_browser(html);
  const std::regex marks("data-marks=\"([^\"]*)\"");
  std::vector<std::string> axes;
  for (std::sregex_iterator it(dom.begin(), dom.end(), marks), end; it != end; ++it) axes.push_back((*it)[1]);
  ASSERT_EQ(axes.size(), 2 + sizes.size());
  std::vector<double> largest;
  for (const std::string& axis : axes) {
    std::istringstream texts(axis);
    double most = 0.0, value = 0.0;
    int n = 0;
    for (std::string text; texts >> text; ++n) value = std::stod(text), most = std::max(most, std::abs(value));
    EXPECT_GE(n, 3) << axis;
    largest.push_back(most);
  }
  const auto has = [&](double size) {
    return std::any_of(largest.begin(), largest.end(), [&](double most) { return most >= 0.5 * size && most <= 2.0 * size; });
  };
  for (double size : sizes) EXPECT_TRUE(has(size)) << size;
  EXPECT_EQ(captured(dom, "data-beyond=\"(\\d+)\""), "0") << "the page is no wider than the window";
  EXPECT_EQ(dom.find("<h2>nodes</h2>"), std::string::npos);
  EXPECT_NE(dom.find("<h2>Loops</h2>"), std::string::npos);
}

TEST_F(ReportInBrowser, ShowsARunThatDidNotFinish) {
  for (const int rows : {300, 1, 0}) {
    report_of(rows, false);
    const std::string dom = shown_in_browser(scratch("report.html"));
    EXPECT_EQ(captured(dom, "data-drawn=\"(\\d+)\""), rows > 1 ? "16" : "0") << rows << " rows";
    EXPECT_NE(dom.find("Not finished: the run is still going on, or was killed."), std::string::npos);
    EXPECT_NE(dom.find(rows == 0   ? "Channels without a row"
                       : rows == 1 ? "Values of the one row"
                                   : "at t = 240 s"),
              std::string::npos)
        << rows;
    EXPECT_EQ(dom.find("<td class=\"warning\">W0301</td>") != std::string::npos, rows > 1) << "noted before the end";
  }
}

}  // namespace
}  // namespace cardan
