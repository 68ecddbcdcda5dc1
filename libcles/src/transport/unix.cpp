// SPDX-License-Identifier: BSL-1.0
#include <cles/identity.hpp>

#include "transport/stream_endpoint.hpp"
#include "transport/transports.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include <fcntl.h>
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

// The user is that of the process which has connected, or at the end that connects, of the one which listens.
identity identify(stream_socket& socket, const std::string& address) {
    identity who{.transport = "unix", .address = address, .name = {}, .uid = {}, .local = true};
    ucred credentials{};
    socklen_t size = sizeof credentials;
    if (::getsockopt(socket.native_handle(), SOL_SOCKET, SO_PEERCRED, &credentials, &size) == 0) {
        who.uid = credentials.uid;
    }
    return who;
}

identity identify_client(stream_socket& socket, const std::string& address, const user_names& users) {
    auto who = identify(socket, address);
    if (const auto known = who.uid ? users.find(*who.uid) : users.end(); known != users.end()) {
        who.name = known->second;
    }
    return who;
}

class listener_errors final : public boost::system::error_category {
  public:
    constexpr listener_errors() noexcept : error_category(0xA6D9'41B3'5F0E'72C8U) {} // see protocol/error.cpp

    [[nodiscard]] const char* name() const noexcept override { return "cles.unix"; }
    [[nodiscard]] std::string message(int user) const override {
        return "user " + std::to_string(static_cast<std::uint32_t>(user)) +
               " listens there, who is neither root, nor the user of this process, nor stated to be that node";
    }
    [[nodiscard]] boost::system::error_condition default_error_condition(int /*user*/) const noexcept override {
        return boost::system::errc::make_error_condition(boost::system::errc::permission_denied);
    }
};

// Other users could answer in the name of any node.
error_code refusal_of(const identity& listener, std::string_view node, const user_names& users) {
    if (!listener.uid) {
        return boost::system::errc::make_error_code(boost::system::errc::permission_denied);
    }
    if (*listener.uid == 0 || *listener.uid == ::geteuid()) {
        return {};
    }
    const auto stated = users.find(*listener.uid);
    const bool is_that_node = stated != users.end() && (node.empty() || stated->second == node);
    return is_that_node ? error_code{} : error_code{static_cast<int>(*listener.uid), untrusted_listener_category()};
}

// Permits all users to connect to a socket file that has just been made; who they are is then known. Another file that
// has been put in its place keeps its permissions.
void permit_everybody(const std::string& path, error_code& code) {
    constexpr mode_t everybody = S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP | S_IROTH | S_IWOTH;
    const int file = ::open(path.c_str(), O_PATH | O_NOFOLLOW | O_CLOEXEC);
    struct stat made {};
    const bool is_open = file >= 0 && ::fstat(file, &made) == 0;
    if (is_open && (!S_ISSOCK(made.st_mode) || made.st_uid != ::geteuid() || made.st_nlink != 1)) {
        code = boost::system::errc::make_error_code(boost::system::errc::permission_denied);
    } else if (!is_open || ::chmod(("/proc/self/fd/" + std::to_string(file)).c_str(), everybody) != 0) {
        code.assign(errno, boost::system::system_category());
    }
    if (file >= 0) {
        close_descriptor(file);
    }
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
        bind(socket, where, endpoint, code);
        if (code == asio::error::address_in_use && !where.path.starts_with('@') && is_stale(where.path, endpoint)) {
            ::unlink(where.path.c_str());
            bind(socket, where, endpoint, code);
        }
        if (code) {
            throw boost::system::system_error{code};
        }
        socket.listen();
        return handle_of(std::make_shared<unix_acceptor>(std::move(socket), where, bounds, users_));
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        return dial_node(executor, where, {}, bounds, std::move(done));
    }

    std::function<void()> dial_node(const asio::any_io_executor& executor, const url& where, std::string_view node,
                                    const limits& bounds, dial_callback done) override {
        const auto dialler = std::make_shared<stream_dialler>(
            executor, bounds, [address = to_string(where)](stream_socket& s) { return identify(s, address); },
            users_.empty() ? std::move(done) : to_trusted(node, std::move(done)));
        dialler->start({address_of(where)});
        return [weak = std::weak_ptr{dialler}] {
            if (const auto alive = weak.lock()) {
                alive->give_up();
            }
        };
    }

  private:
    // Passes the link on only if its listener is trusted. Nothing has been sent on it until then.
    [[nodiscard]] dial_callback to_trusted(std::string_view node, dial_callback done) const {
        return [users = users_, node = std::string{node}, done = std::move(done)](error_code code, link_ptr made) {
            if (made) {
                code = refusal_of(made->peer(), node, users);
            }
            if (made && code) {
                made->close();
                made = nullptr;
            }
            done(code, std::move(made));
        };
    }

    // The file must never have wider permissions, not even for a moment: fchmod before bind sets those that it gets,
    // without those that the umask takes away.
    void bind(listening_socket& socket, const url& where, const stream_address& endpoint, error_code& code) const {
        ::fchmod(socket.native_handle(), S_IRUSR | S_IWUSR);
        socket.bind(endpoint, code);
        const bool has_others =
            std::ranges::any_of(users_, [](const auto& each) { return each.first != 0 && each.first != ::geteuid(); });
        if (!code && has_others && !where.path.starts_with('@')) {
            permit_everybody(where.path, code);
        }
    }

    user_names users_;
};

} // namespace

std::unique_ptr<link_transport> make_unix(user_names users) {
    return std::make_unique<unix_transport>(std::move(users));
}

} // namespace cles::transport

namespace cles {

const boost::system::error_category& untrusted_listener_category() noexcept {
    static const transport::listener_errors category;
    return category;
}

} // namespace cles
