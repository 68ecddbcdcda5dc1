// SPDX-License-Identifier: BSL-1.0
// The paper's localization exchange (section 4.1) by an interface control document and sockets, a complete program as a
// careful engineer writes it by hand. cles_localization.cpp is the same by CLES.
//
//     icd_localization server --port PORT      answers on loopback; port 0: the system's choice, which it prints
//     icd_localization client HOST:PORT        asks once for each line of its input; ends with 1 at the first failure
//
// The document, all in network order:
//
// | bytes | request         | reply                                         |
// | ----- | --------------- | --------------------------------------------- |
// | 2     | message type, 1 | message type, 2                               |
// | 2     | total length, 4 | total length, 44                              |
// | 5 x 8 |                 | utc, lat, lon, velocity, acceleration (IEEE)  |
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <exception>
#include <iostream>
#include <memory>
#include <semaphore>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include <endian.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

using namespace std::literals;
using steady = std::chrono::steady_clock;

struct localization {
    double utc, lat, lon, velocity, acceleration;
};

localization measure() { return {static_cast<double>(std::time(nullptr)), 48.137154, 11.576124, 27.31, -0.12}; }

// --- The document ----------------------------------------------------------------------------------------------------

struct header {
    std::uint16_t type, length;
    bool operator==(const header&) const = default;
};
struct [[gnu::packed]] reply_packet {
    header head;
    std::uint64_t values[5];
};
static_assert(sizeof(header) == 4 && sizeof(reply_packet) == 44);

const header request{htobe16(1), htobe16(sizeof(header))};
const header reply_head{htobe16(2), htobe16(sizeof(reply_packet))};

std::uint64_t to_network(double value) { return htobe64(std::bit_cast<std::uint64_t>(value)); }
double from_network(std::uint64_t bits) { return std::bit_cast<double>(be64toh(bits)); }

reply_packet pack(const localization& at) {
    return {reply_head,
            {to_network(at.utc), to_network(at.lat), to_network(at.lon), to_network(at.velocity),
             to_network(at.acceleration)}};
}

localization unpack(const reply_packet& packet) {
    const auto& values = packet.values;
    return {from_network(values[0]), from_network(values[1]), from_network(values[2]), from_network(values[3]),
            from_network(values[4])};
}

// --- Sockets ---------------------------------------------------------------------------------------------------------

class descriptor {
  public:
    explicit descriptor(int fd = -1) : fd_(fd) {}
    descriptor(descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    descriptor& operator=(descriptor&& other) noexcept {
        std::swap(fd_, other.fd_);
        return *this;
    }
    ~descriptor() {
        if (fd_ >= 0) {
            ::close(fd_);
        }
    }
    [[nodiscard]] int get() const { return fd_; }

  private:
    int fd_;
};

int checked(int result, const std::string& attempted) {
    if (result < 0) {
        throw std::system_error(errno, std::generic_category(), attempted);
    }
    return result;
}

void set_option(const descriptor& socket, int level, int option) {
    const int on = 1;
    checked(::setsockopt(socket.get(), level, option, &on, sizeof on), "setsockopt");
}

void tune(const descriptor& socket) {
    set_option(socket, IPPROTO_TCP, TCP_NODELAY);
    set_option(socket, SOL_SOCKET, SO_KEEPALIVE);
}

// The other end has closed the connection before the first byte.
struct lost : std::runtime_error {
    lost() : std::runtime_error("the connection was lost") {}
};

void wait_for(const descriptor& socket, short event, steady::time_point until) {
    for (int ready = 0; ready == 0;) {
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - steady::now());
        if (until != steady::time_point::max() && left <= 0ms) {
            throw std::runtime_error("no answer in time");
        }
        pollfd waiting{.fd = socket.get(), .events = event, .revents = 0};
        ready = ::poll(&waiting, 1, until == steady::time_point::max() ? -1 : static_cast<int>(left.count()));
        if (ready < 0 && errno == EINTR) {
            ready = 0;
        }
        checked(ready, "poll");
    }
}

// Sends or receives all of it, by `call`.
template <class Bytes, class Call>
void transfer(const descriptor& socket, Bytes bytes, short event, steady::time_point until, Call&& call) {
    const auto size = bytes.size();
    while (!bytes.empty()) {
        const auto moved = call(socket.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
        if (moved > 0) {
            bytes = bytes.subspan(static_cast<std::size_t>(moved));
        } else if (moved == 0 || errno == ECONNRESET || errno == EPIPE) {
            if (bytes.size() < size) {
                throw std::runtime_error("the connection was lost within a packet");
            }
            throw lost();
        } else if (errno == EAGAIN) {
            wait_for(socket, event, until);
        } else if (errno != EINTR) {
            checked(-1, "the connection");
        }
    }
}

template <class T>
void send_packet(const descriptor& socket, const T& packet, steady::time_point until = steady::time_point::max()) {
    transfer(socket, std::as_bytes(std::span{&packet, 1}), POLLOUT, until, ::send);
}

void receive(const descriptor& socket, std::span<std::byte> bytes,
             steady::time_point until = steady::time_point::max()) {
    transfer(socket, bytes, POLLIN, until, ::recv);
}

// --- The server ------------------------------------------------------------------------------------------------------

constexpr int most_clients = 1000;
std::counting_semaphore<most_clients> slots{most_clients};

void serve(const descriptor& client) try {
    tune(client);
    for (header asked{};;) {
        receive(client, std::as_writable_bytes(std::span{&asked, 1}));
        if (asked != request) {
            return;
        }
        send_packet(client, pack(measure()));
    }
} catch (const std::exception&) {
    return; // the client has disconnected
}

[[noreturn]] void run_server(std::uint16_t port) {
    const descriptor listener{checked(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket")};
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(port);
    socklen_t length = sizeof address;
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    set_option(listener, SOL_SOCKET, SO_REUSEADDR); // otherwise it cannot be restarted at once
    checked(::bind(listener.get(), generic, length), "port " + std::to_string(port));
    checked(::listen(listener.get(), SOMAXCONN), "listen");
    checked(::getsockname(listener.get(), generic, &length), "getsockname");
    std::cout << "listening on 127.0.0.1:" << ntohs(address.sin_port) << std::endl;
    for (;;) {
        slots.acquire();
        descriptor client{::accept4(listener.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC)};
        if (client.get() < 0) {
            slots.release();
            if (errno != EINTR && errno != ECONNABORTED) {
                checked(-1, "accept");
            }
            continue;
        }
        std::thread([mine = std::move(client)] {
            serve(mine);
            slots.release();
        }).detach();
    }
}

// --- The client ------------------------------------------------------------------------------------------------------

class client {
  public:
    client(std::string host, std::string port) : host_(std::move(host)), port_(std::move(port)) {}

    localization ask() {
        const auto until = steady::now() + 1s;
        if (socket_.get() >= 0) {
            try {
                return exchange(until);
            } catch (const lost&) {
                socket_ = descriptor(); // the server may have been restarted: tries once more
            }
        }
        socket_ = connect(until);
        return exchange(until);
    }

  private:
    localization exchange(steady::time_point until) {
        send_packet(socket_, request, until);
        reply_packet reply;
        const auto bytes = std::as_writable_bytes(std::span{&reply, 1});
        receive(socket_, bytes.first(sizeof reply.head), until);
        if (reply.head != reply_head) {
            throw std::runtime_error("the server sent something that is not a reply");
        }
        receive(socket_, bytes.subspan(sizeof reply.head), until);
        return unpack(reply);
    }

    [[nodiscard]] descriptor connect(steady::time_point until) const {
        addrinfo hints{};
        hints.ai_socktype = SOCK_STREAM;
        addrinfo* found = nullptr;
        if (const int code = ::getaddrinfo(host_.c_str(), port_.c_str(), &hints, &found); code != 0) {
            throw std::runtime_error(host_ + ": " + ::gai_strerror(code));
        }
        const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> addresses{found, &::freeaddrinfo};
        int error = 0;
        for (const auto* each = found; each != nullptr; each = each->ai_next) {
            descriptor socket{
                checked(::socket(each->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), "socket")};
            tune(socket);
            error = ::connect(socket.get(), each->ai_addr, each->ai_addrlen) == 0 ? 0 : errno;
            if (error == EINPROGRESS || error == EINTR) {
                wait_for(socket, POLLOUT, until);
                socklen_t length = sizeof error;
                checked(::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &error, &length), "getsockopt");
            }
            if (error == 0) {
                return socket;
            }
        }
        throw std::system_error(error, std::generic_category(), host_ + ":" + port_);
    }

    std::string host_, port_;
    descriptor socket_;
};

// --- The program -----------------------------------------------------------------------------------------------------

std::uint16_t to_port(std::string_view text) {
    std::uint16_t port = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
    if (error != std::errc{} || end != text.data() + text.size()) {
        throw std::invalid_argument("'" + std::string{text} + "' is not a port");
    }
    return port;
}

int main(int argc, char* argv[]) try {
    if (argc == 4 && argv[1] == "server"s && argv[2] == "--port"s) {
        run_server(to_port(argv[3]));
    }
    const std::string there = argc == 3 && argv[1] == "client"s ? argv[2] : "";
    const auto colon = there.rfind(':');
    if (colon == std::string::npos) {
        throw std::invalid_argument("usage: icd_localization server --port PORT | client HOST:PORT");
    }
    client asking{there.substr(0, colon), std::to_string(to_port(there.substr(colon + 1)))};
    for (std::string line; std::getline(std::cin, line);) {
        const auto at = asking.ask();
        std::printf("%.0f %.6f %.6f %.2f %.2f\n", at.utc, at.lat, at.lon, at.velocity, at.acceleration);
        std::fflush(stdout);
    }
} catch (const std::exception& failure) {
    std::cerr << "icd_localization: " << failure.what() << '\n';
    return 1;
}
