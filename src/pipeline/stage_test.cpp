#include "pipeline/stage.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "base/child_process.h"
#include "base/error.h"
#include "base/log.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

class Stages : public testing::Test {
 protected:
  // Runs three stages with these settings, and returns the names of those that had to be run.
  std::string run(const std::vector<std::string>& settings, const StageRange& range = {}) {
    std::string ran;
    std::vector<Stage> stages;
    const char* names[] = {"one", "two", "three"};
    for (size_t i = 0; i < 3; ++i) {
      const std::string name = names[i];
      stages.push_back({.name = name,
                        .settings = settings[i],
                        .isComplete = [this, name] { return name != lost_; },
                        .discard =
                            [this, name] {
                              discarded_ += name + " ";
                              record_ = readTextFile(folder_ / "run.json");
                            },
                        .run =
                            [this, &ran, name](bool resumes) {
                              if (name == failing_) throw Error(name, "", "fails", "repair it");
                              ran += (resumes ? "resumed " : "") + name + " ";
                              return "done";
                            }});
    }
    try {
      runStages(folder_.path(), {"test", {{"--minutes", "10"}}}, stages, range);
    } catch (const Error&) {
      ran += "failed";
    }
    return ran;
  }

  TemporaryFolder folder_;
  std::string lost_, failing_;
  std::string discarded_, record_;  // which stages discarded what they had left, and run.json at the last of these
};

TEST_F(Stages, DiscardWhatTheyLeftBeforeTheyMayBeResumed) {
  run({"", "", ""});
  EXPECT_EQ(discarded_, "one two three ");
  discarded_.clear();
  failing_ = "two";
  run({"", "x", ""});
  EXPECT_EQ(discarded_, "two ");
  EXPECT_EQ(record_.find("two"), record_.npos) << "killed here, the stage would be resumed with what it had left";
  run({"", "x", ""});
  EXPECT_EQ(discarded_, "two ") << "a stage that is resumed keeps it";
}

TEST_F(Stages, HaveNamesThatNeedNotBeUtf8) {
  const std::string summary =
      "photos of S\xfc"
      "dstadt";
  EXPECT_NO_THROW(runStages(folder_.path(),
                            {"run S\xfc"
                             "d"},
                            {{.name = "one", .run = [&](bool) { return summary; }}}, {}));
}

TEST_F(Stages, LeaveTheFlagsThatTheyWereRunWith) {
  EXPECT_TRUE(readFlags(folder_.path()).empty());
  run({"", "", ""});
  EXPECT_EQ(readFlags(folder_.path()).at("--minutes"), "10");
  writeFileAtomically(folder_ / "run.json", R"({"flags": {"--steps": 7, "--method": "volume"}})");
  EXPECT_EQ(readFlags(folder_.path()).size(), 1u);
  writeFileAtomically(folder_ / "run.json", "{");
  EXPECT_TRUE(readFlags(folder_.path()).empty());
}

TEST_F(Stages, CountTheTimeOfInterruptedAttempts) {
  int attempts = 0;
  const std::vector<Stage> stages = {{.name = "one", .run = [&](bool) {
                                        std::this_thread::sleep_for(std::chrono::milliseconds(100));
                                        if (++attempts < 3) throw Error("one", "", "fails", "repair it");
                                        return "done";
                                      }}};
  for (int i = 0; i < 2; ++i) EXPECT_THROW(runStages(folder_.path(), {}, stages, {}), Error);
  runStages(folder_.path(), {}, stages, {});
  ASSERT_EQ(readStageRecords(folder_.path()).size(), 1u);
  EXPECT_GE(readStageRecords(folder_.path())[0].seconds, 0.3);
}

TEST_F(Stages, AreRefusedIfTheLastPrecedesTheFirst) {
  run({"", "", ""});
  EXPECT_EQ(run({"", "", ""}, {.from = "three", .until = "two"}), "failed");
  EXPECT_EQ(run({"", "", ""}, {.from = "two", .until = "two"}), "two ");
}

TEST_F(Stages, AreRepeatedIfAnotherProgramHasChangedTheirInputs) {
  std::string input = "a", ran;
  std::vector<Stage> stages;
  for (const char* name : {"one", "two", "three"}) {
    stages.push_back({.name = name, .run = [&ran, name](bool resumes) {
                        ran += std::string(resumes ? "resumed " : "") + name + " ";
                        return "done";
                      }});
  }
  stages[0].run = [&](bool) {
    input += "b";  // what this stage writes, the second one reads
    return "done";
  };
  stages[1].inputs = [&] { return input; };
  const auto run = [&] {
    ran.clear();
    runStages(folder_.path(), {}, stages, {});
    return ran;
  };
  EXPECT_EQ(run(), "two three ");
  EXPECT_EQ(run(), "");
  input = "another";
  EXPECT_EQ(run(), "two three ");
  EXPECT_EQ(run(), "");
  stages[1].inputs = [] { return std::string(); };
  EXPECT_EQ(run(), "two three ") << "they are gone";
  EXPECT_EQ(run(), "");
  stages[1].inputs = [&] { return input; };
  EXPECT_EQ(run(), "") << "runs of former versions record none";
  input = "one more";
  EXPECT_EQ(run(), "two three ") << "now they do";
}

TEST_F(Stages, AreNotResumedWithOtherInputs) {
  std::string input = "a", ran;
  const std::vector<Stage> stages = {{.name = "one",
                                      .inputs = [&] { return input; },
                                      .run = [&](bool resumes) -> std::string {
                                        ran += resumes ? "resumed " : "begun ";
                                        throw Error("one", "", "fails", "repair it");
                                      }}};
  for (const char* next : {"a", "a", "b"}) {
    input = next;
    EXPECT_THROW(runStages(folder_.path(), {}, stages, {}), Error);
  }
  EXPECT_EQ(ran, "begun resumed begun ");
}

TEST_F(Stages, RecordTheirWarningsOnceEach) {
  int attempts = 0;
  const std::vector<Stage> stages = {{.name = "one",
                                      .run = [&](bool) -> std::string {
                                        warn("in each attempt");
                                        warn("attempt {}", ++attempts);
                                        if (attempts < 2) throw Error("one", "", "fails", "repair it");
                                        warn("{}", std::string(5000, 'x'));
                                        return "done";
                                      }},
                                     {.name = "two", .run = [](bool) { return "done"; }}};
  EXPECT_THROW(runStages(folder_.path(), {}, stages, {}), Error);
  for (int i = 0; i < 2; ++i) {  // the second time, both are finished
    runStages(folder_.path(), {}, stages, {});
    const std::vector<StageRecord> records = readStageRecords(folder_.path());
    ASSERT_EQ(records.size(), 2u);
    ASSERT_EQ(records[0].warnings.size(), 4u);
    EXPECT_EQ(records[0].warnings[0], "in each attempt");
    EXPECT_EQ(records[0].warnings[1], "attempt 1");
    EXPECT_EQ(records[0].warnings[2], "attempt 2");
    EXPECT_LT(records[0].warnings[3].size(), 1100u);
    EXPECT_TRUE(records[1].warnings.empty());
  }
}

TEST_F(Stages, AreNotRepeated) {
  EXPECT_EQ(run({"", "", ""}), "one two three ");
  EXPECT_EQ(run({"", "", ""}), "");
}

TEST_F(Stages, AreRepeatedFromTheFirstOneWhoseSettingsChange) {
  run({"a", "b", "c"});
  EXPECT_EQ(run({"a", "x", "c"}), "two three ");
  EXPECT_EQ(run({"y", "x", "c"}), "one two three ");
}

TEST_F(Stages, AreRepeatedFromTheFirstOneWhoseFilesAreLost) {
  run({"", "", ""});
  lost_ = "three";
  EXPECT_EQ(run({"", "", ""}), "three ");
  lost_ = "one";
  EXPECT_EQ(run({"", "", ""}), "one two three ");
}

TEST_F(Stages, GoOnAfterAFailure) {
  failing_ = "two";
  EXPECT_EQ(run({"", "", ""}), "one failed");
  failing_.clear();
  EXPECT_EQ(run({"", "", ""}), "resumed two three ");
}

TEST_F(Stages, DoNotResumeWhatBeganWithOtherSettings) {
  failing_ = "three";
  EXPECT_EQ(run({"", "", ""}), "one two failed");
  failing_.clear();
  EXPECT_EQ(run({"", "", "x"}), "three ");
  failing_ = "three";
  EXPECT_EQ(run({"", "", "y"}), "failed");
  failing_ = "one";
  EXPECT_EQ(run({"", "", "y"}, {.from = "one"}), "failed");
  failing_.clear();
  EXPECT_EQ(run({"", "", "y"}), "resumed one two three ") << "the first may have changed since the third began";
  failing_ = "two";
  EXPECT_EQ(run({"", "y", "y"}), "failed");
  failing_.clear();
  EXPECT_EQ(run({"", "y", "y"}, {.from = "two"}), "two three ") << "to begin anew was asked for";
}

TEST_F(Stages, GoOnWithWhatWasBegunAgainByTheSameCall) {
  run({"", "", ""});
  failing_ = "three";
  EXPECT_EQ(run({"", "", ""}, {.from = "two"}), "two failed");
  EXPECT_EQ(run({"", "", ""}, {.from = "two"}), "failed") << "the second has been run again";
  failing_.clear();
  EXPECT_EQ(run({"", "", ""}, {.from = "two"}), "resumed three ");
  EXPECT_EQ(run({"", "", ""}, {.from = "two"}), "two three ") << "nothing was interrupted";
}

TEST_F(Stages, AreNotBegunIfTheCheckThrows) {
  std::string ran;
  const auto stage = [&](const char* name) {
    return Stage{.name = name, .run = [&ran, name](bool) {
                   ran += name;
                   return "";
                 }};
  };
  EXPECT_THROW(runStages(folder_.path(), {"test"}, {stage("a"), stage("b")}, {},
                         [&] {
                           if (ran == "a") throw Error("b", "", "is interrupted", "");
                         }),
               Error);
  EXPECT_EQ(ran, "a");
}

TEST_F(Stages, ForgetWhatFollowsAStageThatIsInterrupted) {
  run({"", "", ""});
  failing_ = "two";
  EXPECT_EQ(run({"", "", ""}, {.from = "two"}), "failed");
  failing_.clear();
  EXPECT_EQ(run({"", "", ""}), "resumed two three ") << "what the second made may have changed";
}

TEST_F(Stages, RunInTheRangeAskedFor) {
  EXPECT_EQ(run({"", "", ""}, {.until = "two"}), "one two ");
  EXPECT_EQ(run({"", "", ""}, {.until = "one"}), "");
  EXPECT_EQ(run({"", "", ""}), "three ") << "what lies behind the range is kept";
  EXPECT_EQ(run({"", "", ""}, {.from = "two"}), "two three ");
  EXPECT_EQ(run({"", "", ""}, {.from = "four"}), "failed");
}

TEST_F(Stages, RecordTheMemoryOfProgramsAlsoIfTheyFail) {
  const auto runs = [](bool fails) {
    return Stage{
        .name = "one", .run = [fails](bool) {
          ChildProcess process;
          const bool begins = process.start({"dd", "if=/dev/zero", "of=/dev/null", "bs=64M", "count=1"}).empty();
          if (begins) process.wait();
          if (fails || !begins) throw Error("one", "", "fails", "run again");
          return "";
        }};
  };
  EXPECT_THROW(runStages(folder_.path(), {"test"}, {runs(true)}, {}), Error);
  const Stage quick{.name = "one", .run = [](bool) { return ""; }};
  runStages(folder_.path(), {"test"}, {quick}, {});
  const auto records = readStageRecords(folder_.path());
  ASSERT_EQ(records.size(), 1u);
  EXPECT_GT(records[0].peakBytes, int64_t{64} << 20);
}

TEST_F(Stages, ReadWhatIsRecordedOfThoseBeforeThem) {
  std::vector<StageRecord> records;
  const auto stage = [&](const char* name) {
    return Stage{.name = name, .run = [&, name](bool) {
                   records = readStageRecords(folder_.path());
                   return std::string("summary of ") + name;
                 }};
  };
  runStages(folder_.path(), {"test"}, {stage("a"), stage("b"), stage("c")}, {});
  ASSERT_EQ(records.size(), 2u) << "that of the stage itself is not finished";
  EXPECT_EQ(records[1].name, "b");
  EXPECT_EQ(records[1].summary, "summary of b");
  EXPECT_GT(records[1].peakBytes, 0);
  runStages(folder_.path(), {"test"}, {stage("a"), stage("b"), stage("c")}, {.from = "c"});
  EXPECT_EQ(records.size(), 2u) << "finished before";
  writeFileAtomically(folder_ / "run.json", "{");
  EXPECT_TRUE(readStageRecords(folder_.path()).empty());
}

TEST_F(Stages, SurviveADamagedRecord) {
  run({"", "", ""});
  for (const char* text :
       {"", "{", "[]", "{\"stages\": 3}", "{\"stages\": [{\"name\": \"one\", \"peak_bytes\": 1e300, \"seconds\": -1}]}",
        "{\"stages\": [1, {\"name\": 2}, {\"name\": \"one\"}]}"}) {
    writeFileAtomically(folder_ / "run.json", text);
    EXPECT_EQ(run({"", "", ""}), "one two three ") << text;
  }
}

TEST_F(Stages, AreNotRepeatedIfTheRecordHoldsOtherThingsToo) {
  run({"", "", ""});
  std::string record = readTextFile(folder_ / "run.json");
  record.insert(record.find("\"stages\": [") + std::string("\"stages\": [").size(), "3, [], {}, {\"name\": 5},");
  writeFileAtomically(folder_ / "run.json", record);
  EXPECT_EQ(run({"", "", ""}), "");
  EXPECT_EQ(readStageRecords(folder_.path()).size(), 3u);
}

// Three stages of a minute each, of which a resumed one takes half a minute.
std::vector<Stage> minutesEach(const std::function<void(const std::string&)>& run) {
  std::vector<Stage> stages;
  for (const std::string name : {"one", "two", "three"}) {
    stages.push_back({.name = name,
                      .needs =
                          [](bool resumes) {
                            return StageNeeds{resumes ? 30.0 : 60.0, 1000, 7};
                          },
                      .run =
                          [run, name](bool) {
                            run(name);
                            return "done";
                          }});
  }
  return stages;
}

TEST(StagePlan, CountsWhatIsNotFinished) {
  const TemporaryFolder folder;
  const auto stages = minutesEach([](const std::string& name) {
    if (name == "two") throw Error(name, "", "fails", "repair it");
  });
  const RunPlan all = planStages(folder.path(), stages, {});
  EXPECT_EQ(all.entries.size(), 3U);
  EXPECT_EQ(all.total().seconds, 180);
  EXPECT_EQ(all.total().memoryBytes, 1000);
  EXPECT_EQ(all.total().diskBytes, 21);
  EXPECT_EQ(planStages(folder.path(), stages, {.until = "two"}).total().seconds, 120);
  EXPECT_THROW(planStages(folder.path(), stages, {.until = "four"}), Error);
  EXPECT_THROW(runStages(folder.path(), {"test"}, stages, {}), Error);
  const RunPlan left = planStages(folder.path(), stages, {});
  ASSERT_EQ(left.entries.size(), 2U);
  EXPECT_EQ(left.entries[0].stage, "two");
  EXPECT_EQ(left.total().seconds, 90) << "the second stage was begun";
  EXPECT_EQ(planStages(folder.path(), stages, {.from = "one"}).total().seconds, 180);
}

TEST(StagePlan, IsRecordedBeforeTheFirstStageAndForEach) {
  const TemporaryFolder folder;
  std::string record;
  const auto stages = minutesEach([&](const std::string& name) {
    if (name == "two") record = readTextFile(folder / "run.json");
  });
  testing::internal::CaptureStdout();
  runStages(folder.path(), {"test"}, stages, {});
  const std::string printed = testing::internal::GetCapturedStdout();
  EXPECT_NE(record.find("\"seconds\": 180"), record.npos) << record;
  EXPECT_NE(record.find("\"expected_seconds\": 60"), record.npos) << record;
  EXPECT_NE(printed.find("one        0:00: done (about 2 min left)"), printed.npos) << printed;
  EXPECT_NE(printed.find("three      0:00: done\n"), printed.npos) << printed;
}

TEST(StagePlan, IsRecordedAnewAfterAStageThatRevealsIt) {
  const TemporaryFolder folder;
  bool isKnown = false;
  std::vector<Stage> stages = minutesEach([&](const std::string&) { isKnown = true; });
  for (Stage& stage : stages)
    stage.needs = [&isKnown](bool) { return isKnown ? StageNeeds{60, 1000, 7} : StageNeeds{}; };
  stages[0].revealsNeeds = true;
  runStages(folder.path(), {"test"}, stages, {});
  const std::string record = readTextFile(folder / "run.json");
  EXPECT_NE(record.find("\"seconds\": 120"), record.npos) << record;
  EXPECT_NE(record.find("\"disk_bytes\": 14"), record.npos) << record;
}

TEST(StagePlan, HasDurationsForPeople) {
  EXPECT_EQ(describeDuration(44.6), "45 s");
  EXPECT_EQ(describeDuration(600), "10 min");
  EXPECT_EQ(describeDuration(9000), "2.5 h");
}

}  // namespace
}  // namespace tessera
