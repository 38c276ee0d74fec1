// Tests all settings of all methods: shared settings mean the same everywhere, and each setting behaves as documented.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "base/error.h"
#include "representations/field/train/config.h"
#include "representations/hash/train/config.h"
#include "representations/list.h"
#include "representations/mesh/train/config.h"
#include "representations/volume/train/config.h"

namespace tessera {
namespace {

template <class Use>
void forEachMethod(const Use& use) {
  use("field", FieldConfig());
  use("hash", HashConfig());
  use("volume", VolumeConfig());
  use("mesh", MeshConfig());
}

TEST(Settings, AreTestedForAllMethods) {
  std::vector<std::string> methods;
  forEachMethod([&](const char* method, const auto&) { methods.emplace_back(method); });
#define TESSERA_NAME(name, Name) #name,
  EXPECT_EQ(methods, std::vector<std::string>({TESSERA_REPRESENTATIONS(TESSERA_NAME, TESSERA_NAME)}));
#undef TESSERA_NAME
}

struct Listed {
  std::string method, text;  // of the setting's default value
  ConfigField field;         // its pointer is dangling; used for its type and text
};

// Returns, for each key, the settings of the methods that have it.
std::map<std::string, std::vector<Listed>> settingsByKey() {
  std::map<std::string, std::vector<Listed>> byKey;
  forEachMethod([&](const char* method, auto config) {
    for (const ConfigField& field : config.fields()) {
      byKey[std::string(field.name)].push_back({method, configValueText(field), field});
    }
  });
  return byKey;
}

// Changes the value of a field of any type.
void change(const ConfigField& field) {
  std::visit(
      [](auto* value) {
        using T = std::remove_pointer_t<decltype(value)>;
        if constexpr (std::is_same_v<T, bool>) {
          *value = !*value;
        } else if constexpr (std::is_same_v<T, std::string>) {
          *value += "-changed";
        } else if constexpr (std::is_same_v<T, NumberOrAuto>) {
          *value = value->value_or(0) + 1.125;
        } else {
          *value += static_cast<T>(1.125);
        }
      },
      field.value);
}

TEST(Settings, WithTheSameKeyMeanTheSameInAllMethods) {
  const auto isAutoVariant = [](const ConfigField& candidate, const ConfigField& given) {
    return std::holds_alternative<NumberOrAuto*>(candidate.value) && std::holds_alternative<double*>(given.value) &&
           candidate.help.starts_with(std::string(given.help) + "; auto: ");
  };
  size_t shared = 0;
  for (const auto& [key, settings] : settingsByKey()) {
    shared += settings.size() > 1 ? 1 : 0;
    for (const Listed& a : settings) {
      EXPECT_FALSE(a.field.help.empty()) << key;
      for (const Listed& b : settings) {
        // One method may determine by itself what another is given: its help then says so in addition.
        if (isAutoVariant(a.field, b.field) || isAutoVariant(b.field, a.field)) continue;
        EXPECT_EQ(a.field.help, b.field.help) << key << " of " << a.method << " and " << b.method;
        EXPECT_TRUE(a.field.isSameTypeAs(b.field)) << key << " of " << a.method << " and " << b.method;
      }
    }
  }
  EXPECT_GT(shared, 0u);
}

TEST(Settings, HaveOtherDefaultsOnlyWhereAMethodStatesItsOwn) {
  size_t own = 0;
  for (const auto& [key, settings] : settingsByKey()) {
    const Listed* shared = nullptr;
    for (const Listed& each : settings) {
      if (each.field.ownDefault) continue;
      if (shared) {
        EXPECT_EQ(each.text, shared->text) << key << " of " << each.method << " and " << shared->method;
      }
      shared = &each;
    }
    EXPECT_TRUE(shared) << "no method has the default that " << key << " is declared with";
    for (const Listed& each : settings) {
      if (!each.field.ownDefault || !shared) continue;
      ++own;
      EXPECT_NE(each.text, shared->text) << each.method << " states the default of " << key << ", which all have";
    }
  }
  EXPECT_GT(own, 0u);
}

TEST(Settings, HaveTheDefaultThatTheHelpShows) {
  forEachMethod([](const char* method, auto config) {
    const fs::path path = fs::temp_directory_path() / ("tessera_settings_" + std::to_string(::getpid()) + ".toml");
    writeFileAtomically(path, configToToml(config.fields()));  // as `tessera train --help` prints them
    auto other = config;
    for (const ConfigField& field : other.fields()) change(field);
    configFromToml(other.fields(), path);
    fs::remove(path);
    const std::vector<ConfigField> shown = other.fields(), defaults = config.fields();
    for (size_t i = 0; i < shown.size(); ++i) {
      EXPECT_EQ(configValueText(shown[i]), configValueText(defaults[i])) << method << " " << shown[i].name;
    }
  });
}

TEST(Settings, TakeTheirOwnDefaults) {
  forEachMethod([](const char* method, auto config) {
    EXPECT_NO_THROW(config.check()) << method;
    auto set = config;
    const std::vector<ConfigField> defaults = config.fields(), fields = set.fields();
    for (size_t i = 0; i < fields.size(); ++i) {
      change(fields[i]);
      EXPECT_NE(configValueText(fields[i]), configValueText(defaults[i])) << method << " " << fields[i].name;
      setConfigField(fields, std::string(fields[i].name) + "=" + configValueText(defaults[i]));
      EXPECT_EQ(configValueText(fields[i]), configValueText(defaults[i])) << method << " " << fields[i].name;
    }
    EXPECT_NO_THROW(set.check()) << method;
  });
}

// Returns the message of check() for a config in which `set` changes one setting.
template <class Config>
std::string rejectionSubject(Config config, size_t setting, const std::function<void(const ConfigField&)>& set) {
  set(config.fields()[setting]);
  try {
    config.check();
  } catch (const Error& error) {
    return error.subject();
  }
  return "nothing";
}

void setNumber(const ConfigField& field, double number) {
  std::visit(
      [&](auto* value) {
        using T = std::remove_pointer_t<decltype(value)>;
        if constexpr (std::is_same_v<T, NumberOrAuto>) {
          *value = number;
        } else if constexpr (std::is_arithmetic_v<T>) {
          *value = static_cast<T>(number);
        }
      },
      field.value);
}

TEST(Settings, AreRefusedOutOfTheirBounds) {
  forEachMethod([](const char* method, auto config) {
    const std::vector<ConfigField> fields = config.fields();
    for (size_t i = 0; i < fields.size(); ++i) {
      const ConfigField& field = fields[i];
      const ConfigBounds& bounds = field.bounds;
      const bool isReal =
          std::holds_alternative<double*>(field.value) || std::holds_alternative<NumberOrAuto*>(field.value);
      std::vector<double> wrongs;
      if (bounds.isBounded) {
        const double infinity = std::numeric_limits<double>::infinity();
        wrongs.push_back(isReal ? std::nextafter(bounds.low, -infinity) : bounds.low - 1);
        wrongs.push_back(isReal ? std::nextafter(bounds.high, infinity) : bounds.high + 1);
        if (isReal) wrongs.push_back(std::numeric_limits<double>::quiet_NaN());
        if (bounds.divisor > 1) wrongs.push_back(bounds.low + 1);
      }
      for (const int size : bounds.sizes) {
        wrongs.push_back(size + (std::count(bounds.sizes.begin(), bounds.sizes.end(), size + 1) ? 2 : 1));
      }
      const bool isSize = std::holds_alternative<int*>(field.value) || isReal;
      EXPECT_TRUE(!isSize || !wrongs.empty()) << method << " takes any " << field.name;
      const std::string named = "--set " + std::string(field.name) + "=";
      for (const double wrong : wrongs) {
        if (std::count(bounds.sizes.begin(), bounds.sizes.end(), wrong)) continue;
        const std::string refusal = rejectionSubject(config, i, [&](const ConfigField& set) { setNumber(set, wrong); });
        EXPECT_TRUE(refusal.starts_with(named)) << method << " " << field.name << "=" << wrong << ": " << refusal;
      }
      if (bounds.choices.empty()) continue;
      const auto nonsense = [](const ConfigField& set) { *std::get<std::string*>(set.value) = "nonsense"; };
      EXPECT_EQ(rejectionSubject(config, i, nonsense), named + "nonsense") << method;
    }
  });
}

TEST(Settings, AreTakenAtTheirBounds) {
  forEachMethod([](const char* method, auto config) {
    const std::vector<ConfigField> fields = config.fields();
    for (size_t i = 0; i < fields.size(); ++i) {
      if (!fields[i].bounds.isBounded) continue;
      for (const double bound : {fields[i].bounds.low, fields[i].bounds.high}) {
        const std::string refusal = rejectionSubject(config, i, [&](const ConfigField& set) { setNumber(set, bound); });
        // Other settings may then be inconsistent with it.
        const std::string named = "--set " + std::string(fields[i].name) + "=";
        EXPECT_FALSE(refusal.starts_with(named) && refusal.find(' ', 6) == std::string::npos)
            << method << " " << fields[i].name << "=" << bound << ": " << refusal;
      }
    }
  });
}

// A setting that is declared but not listed would not be saved. Fields point at members, and together they cover the
// struct except for its alignment padding.
TEST(Settings, AreAllListed) {
  forEachMethod([](const char* method, auto config) {
    std::map<size_t, std::pair<size_t, std::string>> places;  // begin → end, and name
    const char* const begin = reinterpret_cast<const char*>(&config);
    const std::vector<ConfigField> fields = config.fields();
    for (const ConfigField& field : fields) {
      std::visit(
          [&](const auto* value) {
            const size_t at = static_cast<size_t>(reinterpret_cast<const char*>(value) - begin);
            places[at] = {at + sizeof(*value), std::string(field.name)};
          },
          field.value);
    }
    EXPECT_EQ(places.size(), fields.size()) << method << " lists a setting twice";
    constexpr size_t kAlignment = 8;
    size_t end = 0;
    for (const auto& [at, place] : places) {
      EXPECT_LT(at - end, kAlignment) << method << ": what stands before " << place.second << " is not listed";
      end = place.first;
    }
    EXPECT_LT(sizeof(config) - end, kAlignment) << method;
  });
}

}  // namespace
}  // namespace tessera
