#include "serve/http_server.h"

#include <fmt/format.h>
#include <netinet/tcp.h>
#include <sys/resource.h>

#include <utility>  // which Boost 1.74 does not include itself
// The following must come after utility.
#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <list>
#include <optional>

#include "base/error.h"
#include "serve/compressor.h"

namespace tessera {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;

constexpr size_t kMaxHeader = 32768;  // with the cookies that other servers of this host have set
constexpr size_t kChunk = size_t{1} << 16, kDiscardedAtOnce = 4096;
constexpr size_t kMaxCompressed = size_t{32} << 20;  // bytes of compressed text in the cache
constexpr int kMaxUnsent = 1 << 17;                  // bytes that the system buffers for one client
constexpr size_t kMaxDiscarded = size_t{1} << 20;

// Raises the limit of open files to the maximum that the system allows for the process.
void raiseFileLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace

struct HttpServer::State {
  State(const StaticSite& site, const HttpServerSettings& settings) : site(site), settings(settings) {}

  void accept();

  const StaticSite& site;
  HttpServerSettings settings;
  asio::io_context context{1};
  tcp::acceptor acceptor{context};
  asio::steady_timer poll{context}, acceptAgain{context};
  std::list<std::shared_ptr<Connection>> connections;  // least recently active first
  std::atomic<size_t> count = 0;
  Compressor compressor{kMaxCompressed};  // declared last: it ends before the objects that its callbacks use
};

class HttpServer::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket socket, State& state) : stream_(std::move(socket)), state_(state) {}

  void begin() {
    place_ = state_.connections.insert(state_.connections.end(), shared_from_this());
    state_.count = state_.connections.size();
    read(state_.settings.requestTime);
  }

  void close() {
    if (!open_) return;
    open_ = false;
    beast::error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_both, ignored);
    stream_.close();
    State& state = state_;
    state.connections.erase(place_);  // may be the last reference to this
    state.count = state.connections.size();
  }

 private:
  void heard() { state_.connections.splice(state_.connections.end(), state_.connections, place_); }

  void read(std::chrono::milliseconds time) {
    parser_.emplace();
    parser_->header_limit(kMaxHeader);
    parser_->body_limit(UINT64_MAX);  // no body is read
    stream_.expires_after(time);
    http::async_read_header(stream_, buffer_, *parser_,
                            [self = shared_from_this()](beast::error_code error, size_t) { self->onRequest(error); });
  }

  void onRequest(beast::error_code error) {
    if (!open_) return;
    if (error) {
      // Malformed requests get an answer; clients that have disconnected or timed out do not.
      const bool malformed = error.category() == http::make_error_code(http::error::bad_method).category() &&
                             error != http::error::end_of_stream && error != http::error::partial_message;
      if (!malformed) return close();
      return refuse(error == http::error::header_limit ? 431 : 400);
    }
    heard();
    const auto& message = parser_->get();
    // RFC 9112, section 3.2. With two Host fields a proxy may have used the other one.
    const size_t hosts = message.count(http::field::host);
    if (hosts > 1 || (hosts == 0 && message.version() == 11)) return refuse(400);
    const auto field = [&](http::field name) { return std::string(message[name]); };
    SiteRequest request;
    request.method = std::string(message.method_string());
    request.target = std::string(message.target());
    request.host = field(http::field::host);
    request.range = field(http::field::range);
    request.ifRange = field(http::field::if_range);
    request.ifNoneMatch = field(http::field::if_none_match);
    request.acceptEncoding = field(http::field::accept_encoding);
    // The body is not read and would be taken for the next request, so the connection is closed after the answer.
    const bool hasBody = message.count(http::field::transfer_encoding) > 0 ||
                         (message.has_content_length() && field(http::field::content_length) != "0");
    send(state_.site.answer(request), message.version(), message.keep_alive() && !hasBody);
  }

  void refuse(int status) {
    SiteAnswer refused;
    refused.status = status;
    refused.headers = {{"Content-Type", "text/plain; charset=utf-8"}};
    refused.body = status == 431 ? "the headers of the request are too large; delete the cookies of this host\n"
                                 : "the request is malformed\n";
    refused.length = refused.body.size();
    send(std::move(refused), 11, false);
  }

  void send(SiteAnswer answer, unsigned version, bool keepAlive) {
    answer_ = std::move(answer);
    version_ = version;
    keepAlive_ = keepAlive;
    if (!answer_.isGzipped) return sendHeader();
    state_.compressor.compress(answer_.file, [self = shared_from_this()](const Compressor::Body& body) mutable {
      asio::io_context& context = self->state_.context;  // whose thread must release the connection
      asio::post(context, [self = std::move(self), body] { self->onCompressed(body); });
    });
  }

  void onCompressed(const Compressor::Body& body) {
    if (!open_) return;
    if (!body) return close();  // the file has been truncated
    compressed_ = body;
    answer_.length = body->size();
    sendHeader();
  }

  void sendHeader() {
    header_ =
        fmt::format("HTTP/{}.{} {} {}\r\n", version_ / 10, version_ % 10, answer_.status,
                    std::string(http::obsolete_reason(http::int_to_status(static_cast<unsigned>(answer_.status)))));
    for (const auto& [name, value] : answer_.headers) header_ += fmt::format("{}: {}\r\n", name, value);
    if (answer_.status != 304) header_ += fmt::format("Content-Length: {}\r\n", answer_.length);
    header_ += keepAlive_ ? "Connection: keep-alive\r\n\r\n" : "Connection: close\r\n\r\n";
    std::array<asio::const_buffer, 2> buffers = {asio::buffer(header_), {}};
    if (answer_.sendsBody && answer_.file) left_ = answer_.length;
    if (answer_.sendsBody && !answer_.file) buffers[1] = asio::buffer(std::as_const(answer_.body));
    stream_.expires_after(state_.settings.sendTime);
    asio::async_write(stream_, buffers,
                      [self = shared_from_this()](beast::error_code error, size_t) { self->onSent(error); });
  }

  void onSent(beast::error_code error) {
    if (!open_) return;
    if (error) return close();
    heard();
    if (left_ == 0) {
      chunk_ = {};
      answer_ = {};
      compressed_ = nullptr;
      if (!keepAlive_) return linger();
      return read(state_.settings.idleTime);
    }
    const size_t bytes = std::min<uint64_t>(left_, kChunk);
    asio::const_buffer next;
    if (compressed_) {
      next = asio::buffer(compressed_->data() + (answer_.length - left_), bytes);
    } else {
      chunk_.resize(bytes);
      if (!answer_.file->read(answer_.bytes.end - left_, chunk_)) return close();  // the file has been truncated
      next = asio::buffer(chunk_);
    }
    left_ -= bytes;
    stream_.expires_after(state_.settings.sendTime);
    asio::async_write(stream_, next,
                      [self = shared_from_this()](beast::error_code failed, size_t) { self->onSent(failed); });
  }

  // If a socket is closed before all received bytes are read, the system resets the connection, and the client may lose
  // the answer. So its input is read and discarded for a while.
  void linger() {
    beast::error_code error;
    stream_.socket().shutdown(tcp::socket::shutdown_send, error);
    if (error) return close();
    stream_.expires_after(state_.settings.lingerTime);
    discard();
  }

  void discard() {
    buffer_.clear();
    stream_.async_read_some(buffer_.prepare(kDiscardedAtOnce),
                            [self = shared_from_this()](beast::error_code error, size_t bytes) {
                              if (!self->open_) return;
                              self->discarded_ += bytes;
                              if (error || self->discarded_ > kMaxDiscarded) return self->close();
                              self->discard();
                            });
  }

  beast::tcp_stream stream_;
  State& state_;
  std::list<std::shared_ptr<Connection>>::iterator place_;
  beast::flat_buffer buffer_{kMaxHeader};
  std::optional<http::request_parser<http::empty_body>> parser_;
  SiteAnswer answer_;
  Compressor::Body compressed_;
  std::string header_;
  std::vector<char> chunk_;
  uint64_t left_ = 0;  // bytes still to send of the file or of its compressed form
  size_t discarded_ = 0;
  unsigned version_ = 11;
  bool keepAlive_ = true, open_ = true;
};

void HttpServer::State::accept() {
  acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (error) {  // for example too many open files: closes the least recently active connection and retries later
      if (!connections.empty()) connections.front()->close();
      acceptAgain.expires_after(std::chrono::milliseconds(50));
      acceptAgain.async_wait([this](beast::error_code cancelled) {
        if (!cancelled) accept();
      });
      return;
    }
    beast::error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    // Without this the system would buffer megabytes for each client that does not read.
    ::setsockopt(socket.native_handle(), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kMaxUnsent, sizeof kMaxUnsent);
    if (connections.size() >= settings.maxConnections) connections.front()->close();
    std::make_shared<Connection>(std::move(socket), *this)->begin();
    accept();
  });
}

namespace {

// Throws Error if the address is invalid or in use.
void listenOn(tcp::acceptor& acceptor, const HttpServerSettings& settings) {
  const std::string place = fmt::format("{}:{}", settings.address, settings.port);
  beast::error_code error;
  const auto address = asio::ip::make_address(settings.address, error);
  const auto refuse = [&](const std::string& reason, const std::string& remedy) {
    throw Error(place, "", reason, remedy);
  };
  const char* another = "pass one with --address, such as 127.0.0.1, or 0.0.0.0 for all of this machine's addresses";
  if (error) refuse("is not an IP address", another);
  const tcp::endpoint endpoint(address, settings.port);
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error == asio::error::address_in_use) {
    refuse("is in use by another program", "choose another --port, or 0 for one that is free");
  }
  if (error == beast::errc::address_not_available) refuse("is not an address of this machine", another);
  if (error) refuse("cannot be bound: " + error.message(), "choose another --port or --address");
}

}  // namespace

HttpServer::HttpServer(const StaticSite& site, const HttpServerSettings& settings)
    : state_(std::make_unique<State>(site, settings)) {
  raiseFileLimit();
  listenOn(state_->acceptor, settings);
}

void requireFreeAddress(const HttpServerSettings& settings) {
  asio::io_context context;
  tcp::acceptor acceptor(context);
  listenOn(acceptor, settings);
}

HttpServer::~HttpServer() = default;

uint16_t HttpServer::port() const {
  return state_->acceptor.local_endpoint().port();
}

size_t HttpServer::connections() const {
  return state_->count;
}

void HttpServer::run(const std::function<bool()>& stopped) {
  state_->accept();
  std::function<void()> poll = [&] {
    state_->poll.expires_after(std::chrono::milliseconds(200));
    state_->poll.async_wait([&](beast::error_code error) {
      if (error) return;
      if (stopped()) return state_->context.stop();
      poll();
    });
  };
  if (stopped) poll();
  state_->context.run();
  beast::error_code ignored;
  state_->acceptor.close(ignored);
  while (!state_->connections.empty()) state_->connections.front()->close();
}

void HttpServer::stop() {
  state_->context.stop();
}

}  // namespace tessera
