#include "base/child_process.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(ChildProcess, PassesArgumentsAsTheyAre) {
  ChildProcess process;
  ASSERT_EQ(process.start({"printf", "%s|", "a b", "$HOME; 'c'"}), "");
  EXPECT_TRUE(process.isRunning());
  EXPECT_EQ(process.wait(), "");
  EXPECT_FALSE(process.isRunning());
  EXPECT_EQ(process.lastWords(), "a b|$HOME; 'c'|");
}

TEST(ChildProcess, ReportsHowItEnded) {
  ChildProcess process;
  ASSERT_EQ(process.start({"sh", "-c", "echo no memory >&2; exit 3"}), "");
  EXPECT_EQ(process.wait(), "ended with status 3");
  EXPECT_EQ(process.status(), 3);
  EXPECT_EQ(process.signal(), 0);
  EXPECT_EQ(process.lastWords(), "no memory");
  ASSERT_EQ(process.start({"sh", "-c", "kill -9 $$"}), "");
  EXPECT_EQ(process.wait(), "was ended by signal 9");
  EXPECT_EQ(process.signal(), 9);
  EXPECT_EQ(process.status(), 0);
  ASSERT_EQ(process.start({"cat"}), "") << "it has no input to wait for";
  EXPECT_EQ(process.wait(), "");
}

TEST(ChildProcess, SaysWhyAProgramCannotBeStarted) {
  ChildProcess process;
  EXPECT_EQ(process.start({"no-such-program"}), "No such file or directory");
  EXPECT_FALSE(process.isRunning());
}

TEST(ChildProcess, WaitsForAWhile) {
  ChildProcess process;
  ASSERT_EQ(process.start({"sleep", "0.2"}), "");
  EXPECT_FALSE(process.waitFor(0.01));
  EXPECT_TRUE(process.isRunning());
  EXPECT_TRUE(process.waitFor(60));
  EXPECT_EQ(process.wait(), "");
}

TEST(ChildProcess, AppendsItsOutputToALog) {
  const TemporaryFolder folder;
  for (const char* word : {"one", "two"}) {
    ChildProcess process;
    ASSERT_EQ(process.start({"echo", word}, {.log = folder.path() / "log"}), "");
    EXPECT_EQ(process.wait(), "");
    EXPECT_EQ(process.lastWords(4), word);
  }
  EXPECT_EQ(readTextFile(folder.path() / "log"), "one\ntwo\n");
  fs::create_directories(folder.path() / "a folder");
  try {
    ChildProcess().start({"echo"}, {.log = folder.path() / "a folder"});
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("a folder: cannot be written: "), std::string::npos) << error.what();
  }
}

TEST(ChildProcess, TellsItsPeakMemory) {
  ChildProcess process;
  ASSERT_EQ(process.start({"dd", "if=/dev/zero", "of=/dev/null", "bs=64M", "count=1"}), "");
  EXPECT_EQ(process.wait(), "");
  ASSERT_EQ(process.start({"true"}), "");
  EXPECT_EQ(process.wait(), "");
  EXPECT_GT(takePeakOfChildren(), int64_t{64} << 20);
  EXPECT_EQ(takePeakOfChildren(), 0);
  ASSERT_EQ(process.start({"sleep", "100"}), "");
  process.kill();
  EXPECT_GT(takePeakOfChildren(), 0) << "of killed ones, too";
}

TEST(ChildProcess, IsEndedByAPipeThatNobodyReads) {
  const auto before = ::signal(SIGPIPE, SIG_IGN);  // as `tessera run` does, for itself
  ChildProcess process;
  ASSERT_EQ(process.start({"sh", "-c", "kill -PIPE $$; echo alive"}), "");
  EXPECT_EQ(process.wait(), "was ended by signal 13");
  ::signal(SIGPIPE, before);
}

// Starts a program in a process that is then killed, and returns the number of that program.
pid_t orphan() {
  int ends[2];
  if (::pipe(ends) != 0) return -1;
  const pid_t parent = ::fork();
  if (parent == 0) {
    ChildProcess process;
    process.start({"sh", "-c", "echo $$; exec sleep 600"});
    while (process.lastWords().empty()) ::usleep(1000);
    const int number = std::atoi(process.lastWords().c_str());
    if (::write(ends[1], &number, sizeof number) != sizeof number) ::_exit(1);
    ::pause();
  }
  int number = -1;
  if (::read(ends[0], &number, sizeof number) != sizeof number) number = -1;
  ::close(ends[0]);
  ::close(ends[1]);
  ::kill(parent, SIGKILL);
  ::waitpid(parent, nullptr, 0);
  return number;
}

TEST(ChildProcess, EndsWithTheProcessThatStartedIt) {
  const pid_t program = orphan();
  ASSERT_GT(program, 1);
  bool lives = true;
  for (int i = 0; i < 1000 && lives; ++i) {
    // A zombie has ended; who adopted it may not have noticed yet.
    const std::string state = "/proc/" + std::to_string(program) + "/stat";
    std::ifstream file(state);
    std::string text;
    std::getline(file, text);
    lives = !text.empty() && text.find(") Z ") == text.npos;
    if (lives) ::usleep(10000);
  }
  EXPECT_FALSE(lives);
}

}  // namespace
}  // namespace tessera
