#include "serve/http_server.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <linux/sockios.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <thread>

#include "base/error.h"
#include "base/memory.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// A client socket, closed by its destructor.
class Client {
 public:
  explicit Client(uint16_t port, int receiveBytes = 0) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    if (receiveBytes > 0) ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receiveBytes, sizeof receiveBytes);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) leave();
  }
  ~Client() { leave(); }
  Client(Client&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}

  bool isConnected() const { return socket_ >= 0; }
  // Returns whether the whole text was accepted.
  bool send(const std::string& text) const {
    return ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }
  void leave() {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }

  // Returns the bytes that the system buffers for this client but has not sent yet; the server must be in this process.
  int unsent() const {
    sockaddr_in own{}, peer{};
    socklen_t size = sizeof own;
    ::getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size);
    for (int other = 0; other < 1024; ++other) {
      size = sizeof peer;
      int bytes = 0;
      if (::getpeername(other, reinterpret_cast<sockaddr*>(&peer), &size) == 0 && peer.sin_port == own.sin_port &&
          ::ioctl(other, SIOCOUTQNSD, &bytes) == 0) {
        return bytes;
      }
    }
    return -1;
  }
  // Receives until the server closes the connection, `bytes` have arrived, or the time is over.
  std::string receive(size_t bytes = SIZE_MAX, std::chrono::milliseconds time = 5s) const {
    std::string received;
    const auto end = Clock::now() + time;
    char chunk[65536];
    while (received.size() < bytes) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
      pollfd waiting{socket_, POLLIN, 0};
      if (left <= 0 || ::poll(&waiting, 1, static_cast<int>(left)) <= 0) break;
      const ssize_t count = ::recv(socket_, chunk, std::min(sizeof chunk, bytes - received.size()), 0);
      if (count <= 0) break;
      received.append(chunk, static_cast<size_t>(count));
    }
    return received;
  }
  // Returns whether everything that the server sent was received, and the connection was closed without an error.
  bool isAtEnd() const {
    char byte;
    return ::recv(socket_, &byte, 1, MSG_DONTWAIT) == 0;
  }
  // Returns whether the server closes the connection within `time`.
  bool isLeft(std::chrono::milliseconds time) const {
    const auto end = Clock::now() + time;
    while (Clock::now() < end) {
      char byte;
      pollfd waiting{socket_, POLLIN, 0};
      if (::poll(&waiting, 1, 20) > 0 && ::recv(socket_, &byte, 1, 0) <= 0) return true;
    }
    return false;
  }

 private:
  int socket_;
};

class HttpServerTest : public testing::Test {
 protected:
  HttpServerTest() {
    for (size_t i = 0; i < 3000000; ++i) tile_.push_back(static_cast<char>(i * 7 + i / 251));
    writeFileAtomically(folder_ / "tile.glb", tile_);
    writeFileAtomically(folder_ / "small.txt", std::string_view("hello"));
    site_.emplace(std::vector<SiteFolder>{{"", folder_.path()}}, std::vector<std::string>{});
  }
  ~HttpServerTest() override {
    if (server_) server_->stop();
    if (thread_.joinable()) thread_.join();
  }

  void start(HttpServerSettings settings = {}) {
    settings.port = 0;
    server_.emplace(*site_, settings);
    thread_ = std::thread([this] { server_->run(); });
  }
  Client client() const { return Client(server_->port()); }
  std::string exchange(const std::string& request) const {
    const Client one = client();
    one.send(request);
    return one.receive();
  }
  static std::string get(const std::string& target, const std::string& more = "Connection: close\r\n") {
    return "GET " + target + " HTTP/1.1\r\nHost: localhost\r\n" + more + "\r\n";
  }
  static std::string extractBody(const std::string& answer) {
    const size_t end = answer.find("\r\n\r\n");
    return end == std::string::npos ? "" : answer.substr(end + 4);
  }

  TemporaryFolder folder_;
  std::string tile_;
  std::optional<StaticSite> site_;
  std::optional<HttpServer> server_;
  std::thread thread_;
};

TEST_F(HttpServerTest, SendsFilesWholeAndInParts) {
  start();
  const std::string whole = exchange(get("/tile.glb"));
  EXPECT_TRUE(whole.starts_with("HTTP/1.1 200 OK\r\n"));
  EXPECT_NE(whole.find("Content-Length: 3000000\r\n"), std::string::npos);
  EXPECT_EQ(extractBody(whole), tile_);
  const std::string part = exchange(get("/tile.glb", "Range: bytes=100000-299999\r\nConnection: close\r\n"));
  EXPECT_TRUE(part.starts_with("HTTP/1.1 206 Partial Content\r\n"));
  EXPECT_EQ(extractBody(part), tile_.substr(100000, 200000));
}

TEST_F(HttpServerTest, AnswersSeveralRequestsOnOneConnection) {
  start();
  const Client one = client();
  one.send(get("/small.txt", "") + get("/nothing", "") + "HEAD /tile.glb HTTP/1.1\r\nHost: x\r\n\r\n" +
           get("/small.txt"));
  const std::string all = one.receive();
  EXPECT_TRUE(all.starts_with("HTTP/1.1 200 OK\r\n"));
  EXPECT_NE(all.find("HTTP/1.1 404 Not Found\r\n"), std::string::npos);
  EXPECT_NE(all.find("Content-Length: 3000000\r\n"), std::string::npos);
  EXPECT_TRUE(all.ends_with("\r\n\r\nhello"));
  EXPECT_LT(all.size(), 2000u) << "HEAD sends no body";
}

// The additional memory of sanitizers: AddressSanitizer keeps freed memory in quarantine, and ThreadSanitizer stores
// the last accesses to each word, which takes several times its size.
#if defined(__SANITIZE_ADDRESS__)
constexpr int64_t kSanitizerBytes = int64_t{256} << 20;
#elif defined(__SANITIZE_THREAD__)
constexpr int64_t kSanitizerBytes = int64_t{192} << 20;
#else
constexpr int64_t kSanitizerBytes = 0;
#endif

TEST_F(HttpServerTest, ServesAnHonestClientBesideManyThatStall) {
  start();
  const int64_t before = residentBytes();
  std::vector<Client> stalled;
  for (int i = 0; i < 500; ++i) {
    stalled.push_back(client());
    ASSERT_TRUE(stalled.back().isConnected());
    const char* const kinds[] = {"", "GET /tile.glb HT", "GET /tile.glb HTTP/1.1\r\nHost: x\r\nX: "};
    // The last kind sends a request and does not read the answer.
    stalled.back().send(i % 4 < 3 ? kinds[i % 4] : get("/tile.glb", ""));
  }
  for (int i = 0; i < 200 && server_->connections() < 500; ++i) std::this_thread::sleep_for(10ms);
  EXPECT_EQ(server_->connections(), 500u);
  for (int i = 0; i < 5; ++i) {
    const auto begin = Clock::now();
    EXPECT_EQ(extractBody(exchange(get("/tile.glb"))), tile_);
    EXPECT_LT(Clock::now() - begin, 1s);
  }
  EXPECT_LT(residentBytes() - before, (int64_t{48} << 20) + kSanitizerBytes);
}

TEST_F(HttpServerTest, LimitsTheBytesBufferedByTheSystem) {
  start();
  const Client deaf(server_->port(), 4096);
  deaf.send(get("/tile.glb", ""));
  int unsent = 0;
  for (int i = 0; i < 50 && unsent < 1000; ++i) {
    std::this_thread::sleep_for(10ms);
    unsent = deaf.unsent();
  }
  std::this_thread::sleep_for(100ms);
  unsent = deaf.unsent();
  EXPECT_GT(unsent, 1000);
  EXPECT_LT(unsent, 300000);
}

TEST_F(HttpServerTest, AnswersOthersWhileItCompresses) {
  std::string text;  // of the largest size that is compressed, and hard to compress
  for (uint32_t i = 0, seed = 1; i < uint32_t{16} << 20; ++i) {
    text.push_back("0123456789abcdef"[(seed = seed * 1664525 + 1013904223) >> 28]);
  }
  writeFileAtomically(folder_ / "large.json", text);
  start();
  const Client waiting = client(), alsoWaiting = client();
  for (const Client* one : {&waiting, &alsoWaiting}) {
    one->send(get("/large.json", "Accept-Encoding: gzip\r\nConnection: close\r\n"));
  }
  std::this_thread::sleep_for(50ms);
  EXPECT_EQ(extractBody(exchange(get("/small.txt"))), "hello");
  EXPECT_EQ(waiting.receive(1, 1ms), "") << "the compressed file came first";
  const std::string answer = waiting.receive(SIZE_MAX, 60s);
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 OK\r\n"));
  EXPECT_NE(answer.find("Content-Length: " + std::to_string(extractBody(answer).size()) + "\r\n"), std::string::npos);
  EXPECT_TRUE(extractBody(answer).starts_with("\x1f\x8b"));
  EXPECT_EQ(alsoWaiting.receive(SIZE_MAX, 60s), answer);
}

TEST_F(HttpServerTest, DisconnectsClientsThatStall) {
  HttpServerSettings settings;
  settings.requestTime = settings.idleTime = settings.sendTime = 200ms;
  start(settings);
  const Client silent = client(), slow = client(), deaf = client(), idle = client();
  slow.send("GET /tile.glb HTTP/1.1\r\n");
  deaf.send(get("/tile.glb", ""));
  idle.send(get("/small.txt", ""));
  EXPECT_TRUE(silent.isLeft(3s));
  EXPECT_TRUE(slow.isLeft(3s));
  EXPECT_TRUE(idle.isLeft(3s));
  for (int i = 0; i < 300 && server_->connections() > 0; ++i) std::this_thread::sleep_for(10ms);
  EXPECT_EQ(server_->connections(), 0u);
}

TEST_F(HttpServerTest, SurvivesMalformedRequests) {
  start();
  for (const std::string& request :
       {std::string("\r\n\r\n"), std::string("GET\r\n\r\n"), std::string("GET / HTTP/9.9\r\n\r\n"),
        std::string(100000, 'A'), std::string("GET / HTTP/1.1\r\nContent-Length: x\r\n\r\n"),
        std::string("\0\1\2\3", 4) + "\r\n\r\n", "GET /" + std::string(20000, 'a') + " HTTP/1.1\r\n\r\n",
        std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11)}) {
    const Client one = client();
    one.send(request);
    const std::string answer = one.receive(SIZE_MAX, 500ms);
    EXPECT_TRUE(answer.empty() || answer.starts_with("HTTP/1.1 4")) << answer.substr(0, 80);
  }
  // Sends a request truncated at every position.
  const std::string request = get("/tile.glb", "Range: bytes=0-10\r\n");
  for (size_t length = 0; length < request.size(); ++length) client().send(request.substr(0, length));
  EXPECT_EQ(extractBody(exchange(get("/small.txt"))), "hello");
}

TEST_F(HttpServerTest, TakesTheCookiesOfOtherServersOfItsHost) {
  start();
  EXPECT_TRUE(exchange(get("/small.txt", "Cookie: " + std::string(20000, 'c') + "\r\n")).starts_with("HTTP/1.1 200 "));
  const std::string refused = exchange(get("/small.txt", "Cookie: " + std::string(40000, 'c') + "\r\n"));
  EXPECT_TRUE(refused.starts_with("HTTP/1.1 431 ")) << refused;
  EXPECT_NE(refused.find("delete the cookies"), std::string::npos) << refused;
}

TEST_F(HttpServerTest, IsRefusedAnAddressBeforeItIsNeeded) {
  start();
  HttpServerSettings settings;
  settings.port = server_->port();
  EXPECT_THROW(requireFreeAddress(settings), Error);
  settings.port = 0;
  EXPECT_NO_THROW(requireFreeAddress(settings));
  settings.address = "localhost";
  EXPECT_THROW(requireFreeAddress(settings), Error);
}

TEST_F(HttpServerTest, RequiresExactlyOneHost) {
  start();
  EXPECT_TRUE(exchange("GET /small.txt HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 400 "));
  EXPECT_TRUE(exchange(get("/small.txt", "Host: b\r\n")).starts_with("HTTP/1.1 400 "));
  EXPECT_TRUE(exchange("GET /small.txt HTTP/1.0\r\n\r\n").starts_with("HTTP/1.0 200 "));
}

TEST_F(HttpServerTest, SendsTheOpenedFileWhateverHappensToItsPath) {
  start();
  const Client one(server_->port(), 4096), other(server_->port(), 4096);
  one.send(get("/tile.glb"));
  EXPECT_TRUE(one.receive(100).starts_with("HTTP/1.1 200 "));
  writeFileAtomically(folder_ / "tile.glb", std::string(100, 'x'));
  EXPECT_TRUE(one.receive(SIZE_MAX, 20s).ends_with(tile_.substr(1000)));
  writeFileAtomically(folder_ / "tile.glb", tile_);
  other.send(get("/tile.glb"));
  EXPECT_TRUE(other.receive(100).starts_with("HTTP/1.1 200 "));
  fs::resize_file(folder_ / "tile.glb", 1000000);
  EXPECT_LE(other.receive(SIZE_MAX, 20s).size(), 1000300u) << "an answer that ends early";
  EXPECT_TRUE(other.isAtEnd());
}

TEST_F(HttpServerTest, DoesNotMistakeABodyForTheNextRequest) {
  start();
  const std::string smuggled = get("/tile.glb", "");
  const std::string length = "Content-Length: " + std::to_string(smuggled.size()) + "\r\n";
  const std::string refused = exchange("POST / HTTP/1.1\r\nHost: x\r\n" + length + "\r\n" + smuggled);
  EXPECT_TRUE(refused.starts_with("HTTP/1.1 405 ")) << refused;
  EXPECT_EQ(refused.find("200 OK"), std::string::npos);
  EXPECT_EQ(extractBody(exchange(get("/small.txt", length) + smuggled)), "hello");
}

TEST_F(HttpServerTest, DeliversTheAnswerToClientsThatAreStillSending) {
  start();
  const std::string body(300000, 'x');
  const std::string length = "Content-Length: " + std::to_string(2 * body.size()) + "\r\n";
  for (const std::string& begin : {"POST /small.txt HTTP/1.1\r\nHost: x\r\n" + length + "\r\n",
                                   std::string("no request\r\n\r\n"), get("/small.txt")}) {
    const Client one = client();
    EXPECT_TRUE(one.send(begin + body));
    std::this_thread::sleep_for(100ms);  // the answer is being sent
    EXPECT_TRUE(one.send(body));
    EXPECT_TRUE(one.receive().starts_with("HTTP/1.1 "));
    EXPECT_TRUE(one.isAtEnd());
  }
}

TEST_F(HttpServerTest, LimitsTheTimeForWhichItDiscardsInput) {
  HttpServerSettings settings;
  settings.lingerTime = 300ms;
  start(settings);
  const Client slow = client();
  slow.send("no request\r\n\r\n");
  const auto begin = Clock::now();
  while (slow.send("x") && Clock::now() - begin < 5s) std::this_thread::sleep_for(20ms);
  EXPECT_LT(Clock::now() - begin, 5s);
}

TEST_F(HttpServerTest, LimitsTheBytesThatItDiscards) {
  HttpServerSettings settings;
  settings.lingerTime = 60s;
  start(settings);
  const Client large = client();
  large.send("no request\r\n\r\n");
  const std::string mebibyte(1 << 20, 'x');
  int sent = 0;
  while (sent < 100 && large.send(mebibyte)) ++sent;
  EXPECT_LT(sent, 100);
}

TEST_F(HttpServerTest, ClosesTheLeastRecentlyActiveConnectionBeyondTheLimit) {
  HttpServerSettings settings;
  settings.maxConnections = 3;
  start(settings);
  const Client first = client();
  std::vector<Client> others;
  for (int i = 0; i < 3; ++i) others.push_back(client());
  EXPECT_TRUE(first.isLeft(3s));
  others[2].send(get("/small.txt", ""));
  EXPECT_TRUE(others[2].receive(1000, 300ms).ends_with("hello"));
}

TEST_F(HttpServerTest, ReportsAddressesThatAreInUseOrInvalid) {
  start();
  HttpServerSettings settings;
  settings.port = server_->port();
  const auto said = [&]() -> std::string {
    try {
      HttpServer server(*site_, settings);
      return "";
    } catch (const Error& error) {
      return error.reason() + "; " + error.remedy();
    }
  };
  EXPECT_EQ(said(), "is in use by another program; choose another --port, or 0 for one that is free");
  const std::string another =
      "; pass one with --address, such as 127.0.0.1, or 0.0.0.0 for all of this machine's addresses";
  settings.address = "192.0.2.1";  // reserved for documentation
  EXPECT_EQ(said(), "is not an address of this machine" + another);
  settings.address = "somewhere";
  EXPECT_EQ(said(), "is not an IP address" + another);
}

}  // namespace
}  // namespace tessera
