// An asynchronous HTTP/1.1 server over TCP. A client that stalls costs a socket and small buffers, in the process and
// in the operating system, and is disconnected after a timeout.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "serve/static_site.h"

namespace tessera {

struct HttpServerSettings {
  std::string address = "127.0.0.1";
  uint16_t port = 8080;          // 0: any free port
  size_t maxConnections = 2048;  // beyond this number, the connection that has been idle longest is closed
  std::chrono::milliseconds requestTime{15000};  // to receive the first request of a connection
  std::chrono::milliseconds idleTime{60000};     // to receive another one, after the answer to the one before it
  std::chrono::milliseconds sendTime{30000};     // for a client to receive the next 64 KiB
  std::chrono::milliseconds lingerTime{2000};  // to let a client receive the last answer, while its input is discarded
};

// Throws Error if the address is invalid or in use, for callers that will listen on it much later.
void requireFreeAddress(const HttpServerSettings& settings);

class HttpServer {
 public:
  // Starts to listen. Keeps a reference to `site`. Throws Error if the address is invalid or in use.
  HttpServer(const StaticSite& site, const HttpServerSettings& settings);
  ~HttpServer();

  uint16_t port() const;
  // Serves until `stop` is called (from any thread), or `stopped`, which is called five times a second, returns true.
  void run(const std::function<bool()>& stopped = {});
  void stop();
  size_t connections() const;  // currently open

 private:
  class Connection;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tessera
