// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/http_server.hpp"

#include <cles/error.hpp>

#include "system/private_socket.hpp"

#include <boost/asio/ip/v6_only.hpp>
#include <boost/system/system_error.hpp>

#include <chrono>
#include <utility>

namespace gateway {
namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

namespace {

std::string url_text(const tcp::endpoint& where, bool is_tls) {
    const auto address = where.address().to_string();
    return std::string{is_tls ? "https://" : "http://"} + (where.address().is_v6() ? "[" + address + "]" : address) +
           ":" + std::to_string(where.port());
}

} // namespace

std::string http_server::listen(const tcp::endpoint& where) {
    auto& made = listeners_.emplace_back(io_, where.protocol());
    try {
        tool::open_private(made.acceptor, where.protocol());
        made.acceptor.set_option(tcp::acceptor::reuse_address{true});
        if (where.protocol() == tcp::v6()) {
            made.acceptor.set_option(asio::ip::v6_only{true});
        }
        made.acceptor.bind(where);
        made.acceptor.listen();
        made.acceptor.native_non_blocking(true);
    } catch (const boost::system::system_error& e) {
        throw cles::error(e.code(), "cannot listen at " + url_text(where, tls_ != nullptr));
    }
    accept(made);
    return url_text(made.acceptor.local_endpoint(), tls_ != nullptr);
}

void http_server::accept(listener& at) {
    at.acceptor.async_wait(tcp::acceptor::wait_read, [this, &at](error_code code) {
        if (!at.acceptor.is_open()) {
            return;
        }
        tcp::socket socket{io_};
        if (!code) {
            tool::accept_private(at.acceptor, at.protocol, socket, code);
        }
        if (!code) {
            take(std::move(socket));
        }
        if (!code || code == asio::error::try_again) {
            accept(at);
            return;
        }
        // Such as too many open files, which others may close.
        constexpr std::chrono::milliseconds pause{100};
        constexpr std::chrono::minutes silence{1};
        if (const auto now = std::chrono::steady_clock::now(); !logged_ || now - *logged_ >= silence) {
            logged_ = now;
            log_("cannot accept connections: " + code.message());
        }
        at.pause.expires_after(pause);
        at.pause.async_wait([this, &at](error_code failed) {
            if (!failed) {
                accept(at);
            }
        });
    });
}

void http_server::take(tcp::socket socket) {
    error_code code;
    const auto from = socket.remote_endpoint(code);
    if (code) {
        return;
    }
    socket.set_option(tcp::no_delay{true}, code);
    const auto admitted = limits_.admit(client_address(from.address().to_string()));
    if (admitted.evicted) {
        ++counts_.connections_evicted;
        if (const auto found = connections_.find(*admitted.evicted); found != connections_.end()) {
            const auto closed = found->second;
            closed->close();
        }
    }
    if (admitted.number == 0) {
        ++counts_.connections_refused;
        return;
    }
    ++counts_.connections_accepted;
    ++counts_.connections_open;
    const auto number = admitted.number;
    connection::owner by{.changed = [this, number](bool is_busy) { limits_.set_busy(number, is_busy); },
                         .ended =
                             [this, number] {
                                 limits_.leave(number);
                                 --counts_.connections_open;
                                 connections_.erase(number);
                             }};
    auto stream = tls_ != nullptr ? tls_stream(std::move(socket), *tls_) : plain_stream(std::move(socket));
    const auto made = std::make_shared<connection>(std::move(stream), handler_, counts_, patience_, std::move(by));
    connections_.emplace(number, made);
    made->start();
}

void http_server::stop() {
    for (auto& each : listeners_) {
        error_code ignored;
        each.acceptor.close(ignored);
        each.pause.cancel();
    }
    const auto all = std::exchange(connections_, {});
    for (const auto& [number, each] : all) {
        each->close();
    }
}

} // namespace gateway
