// SPDX-License-Identifier: BSL-1.0
#include "support/link_pair.hpp"

#include <atomic>

#include <unistd.h>

namespace cles::test {

std::ostream& operator<<(std::ostream& out, carrier kind) {
    switch (kind) {
    case carrier::tcp4: return out << "tcp";
    case carrier::tcp6: return out << "tcp over IPv6";
    case carrier::tls: return out << "tls";
    case carrier::unix_file: return out << "unix";
    case carrier::unix_abstract: return out << "unix, abstract";
    case carrier::inproc: return out << "inproc";
    case carrier::inproc_threads: return out << "inproc between threads";
    case carrier::udp4: return out << "udp";
    case carrier::udp6: return out << "udp over IPv6";
    }
    return out;
}

std::string fresh_address(carrier kind) {
    static std::atomic<int> count = 0;
    const auto own = "cles-test-" + std::to_string(::getpid()) + "-" + std::to_string(++count);
    switch (kind) {
    case carrier::tcp4: return "tcp://127.0.0.1:0";
    case carrier::tcp6: return "tcp://[::1]:0";
    case carrier::tls: return "tls://127.0.0.1:0";
    case carrier::udp4: return "udp://127.0.0.1:0";
    case carrier::udp6: return "udp://[::1]:0";
    case carrier::unix_file: return "unix:///tmp/" + own;
    case carrier::unix_abstract: return "unix://@" + own;
    case carrier::inproc:
    case carrier::inproc_threads: return "inproc://" + own;
    }
    return {};
}

void link_end::start() {
    run([this] { link->start(events); });
}

void link_end::say(std::string_view lines) {
    run([this, lines] {
        link->output().append(lines);
        link->flush();
    });
}

void link_end::drop() {
    run([this] {
        events->hook = nullptr;
        if (link) {
            link->close();
        }
        link.reset();
    });
}

link_pair::link_pair(carrier kind, const limits& bounds) : bounds_(bounds) {
    if (kind == carrier::inproc_threads) {
        thread_ = std::make_unique<side_thread>();
        far.home = thread_.get();
    }
    const auto wanted = parse_url(fresh_address(kind));
    transport_ = find_transport(wanted.scheme);
    far.run([&] {
        acceptor_ = transport_->listen(far_io().get_executor(), wanted, bounds_);
        acceptor_->start([this](link_ptr link) { arrived_ = std::move(link); });
        address_ = acceptor_->local();
    });
}

link_pair::~link_pair() {
    near.drop();
    far.drop();
    far.run([this] {
        arrived_.reset();
        acceptor_.reset();
    });
}

void link_pair::connect() {
    boost::system::error_code code;
    transport_->dial(io.get_executor(), address_, bounds_, [&](boost::system::error_code failed, link_ptr made) {
        code = failed;
        near.link = std::move(made);
    });
    until([&] { return near.link || code; });
    BOOST_REQUIRE_MESSAGE(!code, "dialling: " << code.message());
    if (near.link->datagram() != 0) {
        near.say("hello\n");
    }
    accept();
}

void link_pair::accept() {
    until([&] { return far.run([this] { return arrived_ != nullptr; }); });
    far.run([this] { far.link = std::exchange(arrived_, nullptr); });
}

void link_pair::open() {
    connect();
    near.start();
    far.start();
}

void link_pair::stop_listening() {
    far.run([this] { acceptor_.reset(); });
}

} // namespace cles::test
