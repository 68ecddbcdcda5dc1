// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_interface.hpp"

#include <boost/system/system_error.hpp>

#include <cerrno>
#include <cstring>

#include <arpa/inet.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

namespace cles::transport {
namespace {

[[noreturn]] void refuse(int code) { throw boost::system::system_error{code, boost::system::system_category()}; }

/// What the kernel is asked about interfaces with.
class query {
  public:
    explicit query(const std::string& name) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
        if (socket_ < 0) {
            refuse(errno);
        }
        std::memcpy(request_.ifr_name, name.data(), name.size());
    }
    query(const query&) = delete;
    query& operator=(const query&) = delete;
    ~query() { ::close(socket_); }

    const ifreq& ask(unsigned long what) {
        if (::ioctl(socket_, what, &request_) != 0) {
            refuse(errno);
        }
        return request_;
    }

  private:
    int socket_;
    ifreq request_{};
};

} // namespace

ip_interface find_interface(const std::string& name) {
    if (name.empty() || name.size() >= IFNAMSIZ) {
        refuse(ENODEV);
    }
    ip_interface found;
    found.index = query{name}.ask(SIOCGIFINDEX).ifr_ifindex;
    const auto flags = query{name}.ask(SIOCGIFFLAGS).ifr_flags;
    if ((flags & IFF_UP) == 0) {
        refuse(ENETDOWN);
    }
    found.loopback = (flags & IFF_LOOPBACK) != 0;
    query address{name};
    sockaddr_in in{};
    std::memcpy(&in, &address.ask(SIOCGIFADDR).ifr_addr, sizeof in);
    found.address = boost::asio::ip::address_v4{ntohl(in.sin_addr.s_addr)};
    return found;
}

} // namespace cles::transport
