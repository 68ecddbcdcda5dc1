// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <system_error>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

/// What the service replies.
struct localization {
    double utc = 1'700'000'000.5;
    double lat = 48.137154;
    double lon = 11.576124;
    double velocity = 27.31;
    double acceleration = 0.12;
};
BOOST_DESCRIBE_STRUCT(localization, (), (utc, lat, lon, velocity, acceleration))

/// A client that shares no code with the service whose allocations and system calls are counted: a blocking socket
/// with a timeout of some seconds.
class scripted_client {
  public:
    /// `url` is that of an endpoint, "tcp://127.0.0.1:PORT" or "udp://127.0.0.1:PORT".
    explicit scripted_client(const std::string& url)
        : udp_(url.starts_with("udp")),
          socket_(check(::socket(AF_INET, udp_ ? SOCK_DGRAM : SOCK_STREAM, 0), "socket")) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        address.sin_port = htons(static_cast<std::uint16_t>(std::atoi(url.c_str() + url.rfind(':') + 1)));
        const int on = 1;
        const timeval patience{.tv_sec = 10, .tv_usec = 0};
        if (!udp_) {
            check(::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on), "TCP_NODELAY");
        }
        check(::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience), "SO_RCVTIMEO");
        check(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), "connect");
    }
    scripted_client(const scripted_client&) = delete;
    scripted_client& operator=(const scripted_client&) = delete;
    ~scripted_client() { ::close(socket_); }

    void send(std::string_view text) const {
        while (!text.empty()) {
            const auto sent = check(::send(socket_, text.data(), text.size(), MSG_NOSIGNAL), "send");
            text.remove_prefix(static_cast<std::size_t>(sent));
        }
    }

    /// The next line, without its LF.
    std::string receive_line() {
        while (received_.find('\n') == std::string::npos) {
            receive();
        }
        const auto end = received_.find('\n');
        auto line = received_.substr(0, end);
        received_.erase(0, end + 1);
        return line;
    }

    /// Whether the next line arrives within this number of milliseconds.
    bool has_line(int patience) {
        while (received_.find('\n') == std::string::npos) {
            pollfd readable{.fd = socket_, .events = POLLIN, .revents = 0};
            if (check(::poll(&readable, 1, patience), "poll") == 0) {
                return false;
            }
            receive();
        }
        return true;
    }

  private:
    void receive() {
        char bytes[4096];
        const auto got = check(::recv(socket_, bytes, sizeof bytes, 0), "recv");
        if (got == 0) {
            throw std::system_error(ECONNRESET, std::generic_category(), "the service closed the link");
        }
        received_.append(bytes, static_cast<std::size_t>(got));
    }

    template <class T>
    static T check(T result, const char* attempted) {
        if (result < 0) {
            throw std::system_error(errno, std::generic_category(), attempted);
        }
        return result;
    }

    bool udp_;
    int socket_;
    std::string received_;
};
