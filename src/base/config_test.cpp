#include "base/config.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <limits>

#include "base/error.h"

namespace tessera {
namespace {

struct Settings {
  bool flag = false;
  int count = 3;
  int64_t large = 4;
  double rate = 0.5;
  NumberOrAuto weight = 0.25;
  std::string name = "first";

  std::vector<ConfigField> fields() {
    return {{"flag", "a switch", &flag},        {"count", "how many", &count},
            {"large", "how many more", &large}, {"learning_rate", "how fast", &rate},
            {"weight", "how much", &weight},    {"name", "what it is called", &name}};
  }
};

class ConfigFile : public testing::Test {
 protected:
  ~ConfigFile() override { fs::remove(path_); }

  Settings read(std::string_view text) {
    writeFileAtomically(path_, text);
    Settings settings;
    configFromToml(settings.fields(), path_);
    return settings;
  }
  Settings roundTrip(Settings settings) { return read(configToToml(settings.fields())); }
  std::string catchErrorMessage(std::string_view text) {
    try {
      read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  const fs::path path_ = fs::temp_directory_path() / ("tessera_config_" + std::to_string(::getpid()) + ".toml");
};

std::string errorOfSet(std::string_view assignment) {
  Settings settings;
  try {
    setConfigField(settings.fields(), assignment);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(Config, SetsFieldsOfEveryType) {
  Settings settings;
  for (const char* assignment :
       {"flag=true", "count=-7", "large=9007199254740993", "learning_rate=1e-3", "name=a=b c"}) {
    setConfigField(settings.fields(), assignment);
  }
  EXPECT_TRUE(settings.flag);
  EXPECT_EQ(settings.count, -7);
  EXPECT_EQ(settings.large, 9007199254740993);
  EXPECT_EQ(settings.rate, 1e-3);
  EXPECT_EQ(settings.name, "a=b c");  // only the first equals sign separates key and value
}

TEST_F(ConfigFile, AcceptsANumberOrAuto) {
  Settings settings;
  const ConfigField weight = settings.fields()[4];
  EXPECT_FALSE(weight.isAuto());
  setConfigField(settings.fields(), "weight=auto");
  EXPECT_FALSE(settings.weight);
  EXPECT_TRUE(weight.isAuto());
  EXPECT_EQ(configValueText(weight), "auto");
  EXPECT_FALSE(roundTrip(settings).weight);
  setConfigField(settings.fields(), "weight=2");
  EXPECT_EQ(settings.weight, 2);
  EXPECT_EQ(roundTrip(settings).weight, 2);
  EXPECT_EQ(read("weight = 3").weight, 3) << "a whole number is a number";
  EXPECT_TRUE(contains(errorOfSet("weight=automatic"), "a number or auto"));
  EXPECT_TRUE(contains(catchErrorMessage("weight = \"automatic\""), "a number or auto"));
  EXPECT_TRUE(contains(catchErrorMessage("weight = true"), "a number or auto"));
}

TEST(Config, NamesTheNearestFieldWhenItDoesNotKnowOne) {
  const std::string error = errorOfSet("lerning_rate=2");
  EXPECT_TRUE(contains(error, "lerning_rate")) << error;
  EXPECT_TRUE(contains(error, "did you mean 'learning_rate'?")) << error;
  EXPECT_TRUE(contains(errorOfSet("cuont=2"), "did you mean 'count'?"));
}

TEST(Config, NamesTheCurrentNameOfASettingThatWasRenamed) {
  EXPECT_TRUE(contains(errorOfSet("rate=2"), "its name is 'learning_rate' now"));
  EXPECT_TRUE(contains(errorOfSet("padding=0.1"), "did you mean")) << "its current name is not one of these settings";
}

TEST(Config, RefusesValuesOfAnotherTypeAndLeavesTheFieldAlone) {
  for (const char* assignment : {"flag=1", "flag=yes", "flag=", "count=2.5", "count=2x", "count= 2", "count=",
                                 "count=3000000000", "large=1e3", "learning_rate=fast", "learning_rate=", "count"}) {
    Settings settings;
    EXPECT_THROW(setConfigField(settings.fields(), assignment), Error) << assignment;
    EXPECT_FALSE(settings.flag);
    EXPECT_EQ(settings.count, 3) << assignment;
    EXPECT_EQ(settings.large, 4);
    EXPECT_EQ(settings.rate, 0.5);
  }
  EXPECT_TRUE(contains(errorOfSet("count=2.5"), "a whole number"));
  EXPECT_TRUE(contains(errorOfSet("flag=1"), "true or false"));
}

TEST_F(ConfigFile, ReadsBackWhatItWrote) {
  Settings settings;
  settings.flag = true;
  settings.count = std::numeric_limits<int>::min();
  settings.large = std::numeric_limits<int64_t>::max();
  settings.rate = 0.1 + 0.2;
  settings.name = "quoted \"text\" with \\ and # and\ttab";
  const Settings again = roundTrip(settings);
  EXPECT_EQ(again.flag, settings.flag);
  EXPECT_EQ(again.count, settings.count);
  EXPECT_EQ(again.large, settings.large);
  EXPECT_EQ(again.rate, settings.rate);
  EXPECT_EQ(again.name, settings.name);
}

TEST_F(ConfigFile, KeepsEveryBitOfNumbersWhateverTheyLookLike) {
  for (const double rate : {0.0, -0.0, 1.0, -3.0, 1e-6, 5e-324, 1e10, 1e300, 123456789012345680.0, 1.0 / 3,
                            std::numeric_limits<double>::infinity()}) {
    Settings settings;
    settings.rate = rate;
    const double again = roundTrip(settings).rate;
    EXPECT_EQ(again, rate);
    EXPECT_EQ(std::signbit(again), std::signbit(rate));
  }
}

TEST_F(ConfigFile, KeepsTextOfAnyContent) {
  for (const char* name : {"", " ", "line\nbreak", "'single'", "\"\"\"", "C:\\path", "größe", "true", "1.5"}) {
    Settings settings;
    settings.name = name;
    EXPECT_EQ(roundTrip(settings).name, name);
  }
}

TEST_F(ConfigFile, WritesTheHelpTextAboveEachLine) {
  Settings settings;
  const std::string text = configToToml(settings.fields());
  EXPECT_EQ(text.substr(0, text.find('\n')), "flag = false  # a switch");
  EXPECT_TRUE(contains(text, "learning_rate = 0.5  # how fast\n")) << text;
}

TEST_F(ConfigFile, LeavesFieldsThatAreNotInTheFileAtTheirDefaults) {
  const Settings settings = read("count = 12\n");
  EXPECT_EQ(settings.count, 12);
  EXPECT_EQ(settings.rate, 0.5);
  EXPECT_EQ(settings.name, "first");
}

TEST_F(ConfigFile, AcceptsAWholeNumberForARealSetting) {
  EXPECT_EQ(read("learning_rate = 2\n").rate, 2.0);
}

TEST_F(ConfigFile, RefusesUnknownKeysWithFileLineAndSuggestion) {
  const std::string error = catchErrorMessage("count = 1\n\nnmae = \"x\"\n");
  EXPECT_TRUE(contains(error, path_.string())) << error;
  EXPECT_TRUE(contains(error, "line 3")) << error;
  EXPECT_TRUE(contains(error, "did you mean 'name'?")) << error;
}

TEST_F(ConfigFile, RefusesWrongTypesWithFileAndLine) {
  for (const char* line : {"count = \"many\"", "count = 2.5", "count = 3000000000", "learning_rate = \"fast\"",
                           "name = 4", "flag = \"true\"", "flag = 2", "count = true", "count = [1]", "[count]\n"}) {
    const std::string error = catchErrorMessage("# first line\n" + std::string(line) + "\n");
    EXPECT_TRUE(contains(error, path_.string())) << line << ": " << error;
    EXPECT_TRUE(contains(error, "line 2")) << line << ": " << error;
    EXPECT_TRUE(contains(error, " requires ")) << line << ": " << error;
  }
}

TEST_F(ConfigFile, RejectsFilesThatAreNotToml) {
  const std::string error = catchErrorMessage("count = 1\ncount 2\n");
  EXPECT_TRUE(contains(error, path_.string())) << error;
  EXPECT_TRUE(contains(error, "line 2")) << error;
  EXPECT_TRUE(contains(catchErrorMessage("count = 1\ncount = 2\n"), "line 2"));  // a repeated key
}

TEST_F(ConfigFile, NamesAFileThatIsNotThere) {
  Settings settings;
  try {
    configFromToml(settings.fields(), "/nonexistent/config.toml");
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), "/nonexistent/config.toml");
  }
}

}  // namespace
}  // namespace tessera
