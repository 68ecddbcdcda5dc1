// SPDX-License-Identifier: BSL-1.0
#include "node/session/connections.hpp"

#include "node/base/scoped_flag.hpp"
#include "node/local_node.hpp"
#include "node/membership/reachable_endpoints.hpp"
#include "node/routing/other_pools.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

// How many links may close gracefully at a time: each holds a descriptor for up to `limits::discard`.
std::size_t max_closing_links(const limits& bounds) { return std::max<std::size_t>(64, bounds.links / 4); }

} // namespace

/// The owner of a refused link: ignores its input, and waits until the link has closed.
class connections::refused final : public link_events {
  public:
    refused(std::weak_ptr<local_node> host, const link& which) noexcept : host_(std::move(host)), which_(which) {}
    void on_line(std::string_view) override {}
    void on_overlong(std::string_view) override {}
    void on_batch() override {}
    void on_end() override {}
    void on_writable() override {}
    void on_lost(boost::system::error_code) override {
        if (const auto host = host_.lock()) {
            host->connections().on_closed_gracefully(which_);
        }
    }

  private:
    std::weak_ptr<local_node> host_;
    const link& which_; // owns this object
};

connections::connections(local_node& host) noexcept : host_(host), admission_(host.bounds()) {}

void connections::stop() {
    for (const auto& [key, parting] : std::exchange(closing_links_, {})) {
        parting->close();
    }
}

void connections::close_gracefully(link_ptr parting) {
    parting->flush();
    if (parting->unsent() != 0 || closing_links_.size() >= max_closing_links(host_.bounds())) {
        parting->close(); // do not wait for a peer that does not read
        return;
    }
    closing_links_.emplace(parting.get(), parting);
    parting->finish();
}

void connections::on_closed_gracefully(const link& parting) { closing_links_.erase(&parting); }

void connections::on_accepted(link_ptr arrived, bool counted) {
    if (host_.stopped()) {
        arrived->close();
        return;
    }
    if (counted && !has_capacity(*arrived)) {
        reject(std::move(arrived));
        return;
    }
    if (counted) {
        ++host_.node().counts.links_accepted;
    }
    adopt(std::move(arrived), counted ? connection::origin::accepted : connection::origin::local);
}

bool connections::has_capacity(const link& arrived) {
    const auto most = host_.bounds().links;
    if (arrived.datagram() == 0) {
        return admission_.ensure_capacity(holder_of(arrived.peer()), host_.now());
    }
    if (sources_ >= most) {
        drop_idle_sources();
    }
    return sources_ < most;
}

// All at once, so that many new sources do not cost a search each.
void connections::drop_idle_sources() {
    for (const auto& c : all()) {
        if (c->is_source() && c->is_idle()) {
            c->abandon("evicted, because the limit of sources was reached");
        }
    }
}

void connections::reject(link_ptr arrived) {
    ++host_.node().counts.links_refused;
    if (arrived->datagram() != 0) { // the request to refuse follows, with the id for the reply
        adopt(std::move(arrived), connection::origin::refused);
        return;
    }
    append_link_refusal(arrived->output(), host_.node());
    // The link is read until it closes: closing it with unread input would send a reset, which could discard the line.
    arrived->start(std::make_shared<refused>(host_.weak_from_this(), *arrived));
    close_gracefully(std::move(arrived));
}

std::shared_ptr<connection> connections::adopt(link_ptr made, connection::origin from) {
    const bool counted = from == connection::origin::accepted;
    const auto address = counted ? holder_of(made->peer()) : std::string{};
    auto c = std::make_shared<connection>(host_.shared_from_this(), std::move(made), from, ++last_number_);
    open_.emplace(c->number(), c);
    if (counted) {
        if (c->is_datagram()) {
            ++sources_;
        } else {
            admission_.enter(c->monitor(), address);
        }
    }
    ++host_.node().counts.links_open;
    if (from == connection::origin::dialled && !c->is_datagram()) {
        c->session().expect_refusal();
    }
    if (host_.closing()) {
        refuse_new_requests();
    }
    c->start();
    return c;
}

// This process's own handlers may still send requests: they need them to complete.
void connections::refuse_new_requests() {
    for (const auto& [key, c] : open_) {
        if (c->from() != connection::origin::local) {
            c->session().serving().refuse_new_requests();
        }
    }
}

void connections::on_security_changed() {
    const auto& security = *host_.node().security;
    for (const auto& c : all()) {
        const auto& peer = c->peer();
        if (!peer.name.empty() && !security.is_member(peer.name)) {
            host_.post_log(log_level::info, peer.name + " is no longer a member of the fleet: closed its link",
                           peer.address);
            c->abandon(peer.name + " is no longer a member of the fleet");
        } else if (auto& serving = c->session().serving(); !serving.are_bindings_permitted()) {
            if (c->is_datagram()) { // the peer would not notice, and copies of its requests would run again
                serving.drop_forbidden_bindings();
                host_.post_log(log_level::info,
                               peer.name + " may no longer bind what it has bound: ended these bindings", peer.address);
                continue;
            }
            host_.post_log(log_level::info, peer.name + " may no longer bind what it has bound: closed its link",
                           peer.address);
            c->close();
        } else if (peer.transport == "tls" && c->usable()) {
            c->session().send_hello();
        }
    }
}

void connections::forget(connection& c, std::uint64_t received, std::uint64_t sent) {
    if (open_.erase(c.number()) == 0) {
        return;
    }
    if (c.from() == connection::origin::accepted) {
        if (c.is_datagram()) {
            --sources_;
        } else {
            admission_.leave(c.monitor());
        }
    }
    auto& counts = host_.node().counts;
    --counts.links_open;
    ++counts.links_lost;
    counts.bytes_received += received;
    counts.bytes_sent += sent;
    host_.peer_channels().drop(c);
}

bool connections::cancel(std::uint64_t id) {
    return std::ranges::any_of(open_, [id](const auto& each) { return each.second->session().asking().cancel(id); });
}

std::vector<std::shared_ptr<connection>> connections::all() const {
    std::vector<std::shared_ptr<connection>> result;
    result.reserve(open_.size());
    for (const auto& [key, c] : open_) {
        result.push_back(c);
    }
    return result;
}

// -- the end -------------------------------------------------------------------------------------------------------

graceful_shutdown::graceful_shutdown(local_node& host, std::uint64_t ticket, std::chrono::milliseconds limit,
                                     detail::pending_ptr done)
    : host_(host), ticket_(ticket), done_(std::move(done)) {
    const auto longest = std::chrono::milliseconds{std::chrono::hours{24}};
    host_.deadlines().arm(*this, host_.now() + std::clamp(limit, std::chrono::milliseconds{0}, longest));
}

void graceful_shutdown::check() {
    if (looking_ || !done_) {
        return;
    }
    const scoped_flag during{looking_};
    const auto serves = [](const auto& c) {
        const auto& serving = c->session().serving();
        return serving.in_flight() != 0 || serving.is_behind();
    };
    if (ending_ || std::ranges::none_of(host_.connections().all(), serves)) {
        end_links();
    }
}

// Includes links that have been accepted since the last call. A link ends when its peer has closed it too, and so has
// read everything.
void graceful_shutdown::end_links() {
    if (!std::exchange(ending_, true)) {
        host_.deadlines().arm(*this, host_.now() + host_.bounds().discard);
    }
    bool open = false;
    for (const auto& c : host_.connections().all()) {
        if (!c->is_datagram()) {
            c->session().send_leave_notice();
            open = true;
        } else {
            c->flush();
        }
    }
    const auto* const pools = host_.node().pools;
    if (!open && (pools == nullptr || pools->has_left())) {
        end();
    }
}

void graceful_shutdown::on_deadline(time_point) {
    if (ending_) { // some peers do not close
        end();
        return;
    }
    const scoped_flag during{looking_};
    for (const auto& c : host_.connections().all()) {
        c->session().serving().abort_running();
    }
    end_links(); // without waiting for peers that do not read
}

void graceful_shutdown::end() {
    host_.deadlines().disarm(*this);
    if (done_) { // else `give_up` has returned it
        host_.node().completions.succeed(std::move(done_), "{}");
    }
}

detail::pending_ptr graceful_shutdown::give_up() {
    host_.deadlines().disarm(*this);
    return std::move(done_);
}

// -- listeners -----------------------------------------------------------------------------------------------------

void listeners::start(acceptor& made, bool counted) {
    made.start([weak = host_.weak_from_this(), counted](link_ptr arrived) {
        if (const auto host = weak.lock()) {
            host->connections().on_accepted(std::move(arrived), counted);
        } else {
            arrived->close();
        }
    });
}

std::string listeners::listen(std::string_view where, bool insecure) {
    const auto address = parse_url(where);
    auto& environment = host_.environment();
    if (!environment.has_transport(address.scheme)) {
        throw error(errc::unknown_scheme, "'" + address.scheme + "' in '" + std::string{where} + "'");
    }
    if (host_.node().security && !environment.is_trusted(address)) {
        throw error(errc::insecure_listen, "'" + address.scheme + "' is refused with security: use 'tls' instead of '" +
                                               std::string{where} + "'");
    }
    if (!insecure && !host_.node().security && environment.is_exposed(address)) {
        throw error(errc::insecure_listen, "'" + std::string{where} +
                                               "' can be reached from other hosts, which are not authenticated; "
                                               "set 'insecure' to allow it");
    }
    std::unique_ptr<acceptor> made;
    try {
        made = environment.listen(address, host_.bounds());
    } catch (const boost::system::system_error& e) {
        throw error(e.code(), "cannot listen on '" + std::string{where} + "': " + e.code().message());
    }
    start(*made, true);
    auto local = to_string(made->local());
    open_.push_back(std::move(made));
    return local;
}

std::string listeners::self_endpoint() const {
    return "self/" + std::to_string(reinterpret_cast<std::uintptr_t>(&host_));
}

std::string listeners::shared_endpoint(std::string_view name) const {
    return host_.environment().local_scope() + "/" + std::string{name};
}

void listeners::open_local_endpoints() {
    std::vector<std::string> endpoints{self_endpoint()};
    if (!host_.node().security) { // requests of other nodes would count as its own
        endpoints.push_back(shared_endpoint(host_.node().name));
    }
    for (const auto& endpoint : endpoints) {
        try {
            auto made = host_.environment().listen({.scheme = "inproc", .host = endpoint, .port = 0, .path = {}},
                                                   host_.bounds());
            start(*made, false);
            local_acceptors_.push_back(std::move(made));
        } catch (const boost::system::system_error&) {
            host_.write_log(log_level::warning, "another node in this process has the name '" + host_.node().name +
                                                    "', and gets its requests");
        }
    }
}

void listeners::close() {
    open_.clear();
    local_acceptors_.clear();
}

void listeners::reject() {
    for (const auto& each : open_) {
        each->accept_waiting();
    }
    std::erase_if(open_, [](const auto& each) { return each->local().scheme != "udp"; });
}

} // namespace cles::core
