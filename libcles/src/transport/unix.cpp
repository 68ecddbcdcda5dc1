// SPDX-License-Identifier: BSL-1.0
#include "transport/stream_endpoint.hpp"
#include "transport/transports.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>

#include <algorithm>
#include <string>
#include <utility>

#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

namespace cles::transport {
namespace asio = boost::asio;
using local_protocol = asio::local::stream_protocol;
using boost::system::error_code;

namespace {

stream_address address_of(const url& where) {
    auto path = where.path;
    if (path.starts_with('@')) {
        path.front() = '\0';
    }
    return local_protocol::endpoint{path};
}

identity identify(const std::string& address) {
    return {.transport = "unix", .address = address, .name = {}, .uid = {}, .local = true};
}

identity identify_client(stream_socket& socket, const std::string& address, const user_names& users) {
    auto who = identify(address);
    ucred credentials{};
    socklen_t size = sizeof credentials;
    if (::getsockopt(socket.native_handle(), SOL_SOCKET, SO_PEERCRED, &credentials, &size) == 0) {
        who.uid = credentials.uid;
        if (const auto known = users.find(credentials.uid); known != users.end()) {
            who.name = known->second;
        }
    }
    return who;
}

// Whether it is a socket file that a dead process has left behind. Connecting alone is not enough: a regular file
// refuses too, and belongs to someone.
bool is_stale(const std::string& path, const stream_address& endpoint) {
    struct stat what {};
    if (::lstat(path.c_str(), &what) != 0 || !S_ISSOCK(what.st_mode)) {
        return false;
    }
    asio::io_context unused;
    auto probe = make_private<stream_socket>(unused.get_executor(), endpoint.protocol());
    error_code code;
    probe.connect(endpoint, code);
    return code == asio::error::connection_refused;
}

// Removes its socket file.
class unix_acceptor final : public stream_acceptor {
  public:
    unix_acceptor(listening_socket socket, const url& where, const limits& bounds, const user_names& users)
        : stream_acceptor(std::move(socket), where, bounds, [address = to_string(where), users](stream_socket& s) {
              return identify_client(s, address, users);
          }) {
        struct stat made {};
        if (!where.path.starts_with('@') && ::stat(where.path.c_str(), &made) == 0) {
            device_ = made.st_dev;
            inode_ = made.st_ino;
        }
    }

    void close() override {
        stream_acceptor::close();
        const auto path = local().path;
        struct stat now {};
        // Another process may have put its own socket there meanwhile.
        if (inode_ != 0 && ::stat(path.c_str(), &now) == 0 && now.st_dev == device_ && now.st_ino == inode_) {
            ::unlink(path.c_str());
        }
        inode_ = 0;
    }

  private:
    dev_t device_ = 0;
    ino_t inode_ = 0;
};

class unix_transport final : public link_transport {
  public:
    explicit unix_transport(user_names users) : users_(std::move(users)) {}

    [[nodiscard]] bool is_exposed(const url&) const override { return false; }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where,
                                     const limits& bounds) override {
        const auto endpoint = address_of(where);
        auto socket = make_private<listening_socket>(executor, endpoint.protocol());
        error_code code;
        bind(socket, endpoint, code);
        if (code == asio::error::address_in_use && !where.path.starts_with('@') && is_stale(where.path, endpoint)) {
            ::unlink(where.path.c_str());
            bind(socket, endpoint, code);
        }
        if (code) {
            throw boost::system::system_error{code};
        }
        socket.listen();
        return handle_of(std::make_shared<unix_acceptor>(std::move(socket), where, bounds, users_));
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        const auto dialler = std::make_shared<stream_dialler>(
            executor, bounds, [address = to_string(where)](stream_socket&) { return identify(address); },
            std::move(done));
        dialler->start({address_of(where)});
        return [weak = std::weak_ptr{dialler}] {
            if (const auto alive = weak.lock()) {
                alive->give_up();
            }
        };
    }

  private:
    // The file must never have wider permissions, not even for a moment: fchmod before bind sets those that it gets.
    void bind(listening_socket& socket, const stream_address& endpoint, error_code& code) const {
        constexpr mode_t owner = S_IRUSR | S_IWUSR;
        constexpr mode_t everybody = owner | S_IRGRP | S_IWGRP | S_IROTH | S_IWOTH;
        const bool has_others =
            std::ranges::any_of(users_, [](const auto& each) { return each.first != 0 && each.first != ::geteuid(); });
        ::fchmod(socket.native_handle(), has_others ? everybody : owner);
        socket.bind(endpoint, code);
    }

    user_names users_;
};

} // namespace

std::unique_ptr<link_transport> make_unix(user_names users) {
    return std::make_unique<unix_transport>(std::move(users));
}

} // namespace cles::transport
