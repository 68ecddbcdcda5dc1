// SPDX-License-Identifier: BSL-1.0
#include "tls/tls_transport.hpp"

#include <cles/boottime_clock.hpp>

#include "protocol/line.hpp"
#include "security/link_admission.hpp"
#include "tls/tls_context.hpp"
#include "tls/tls_engine.hpp"
#include "tls/tls_error.hpp"
#include "transport/ip_host.hpp"
#include "transport/stream_codec.hpp"
#include "transport/transports.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <optional>
#include <span>
#include <utility>

namespace cles::tls {
namespace asio = boost::asio;

namespace {

using admission = security::link_admission;
using boost::system::error_code;

tls_errc code_of(admission::reason why) noexcept {
    switch (why) {
    case admission::reason::none: break;
    case admission::reason::protocol: return tls_errc::bad_admission;
    case admission::reason::not_member:
    case admission::reason::removed: return tls_errc::not_member;
    case admission::reason::other_name: return tls_errc::other_name;
    case admission::reason::by_peer: return tls_errc::refused_by_peer;
    case admission::reason::busy: return tls_errc::busy;
    }
    return tls_errc::failed;
}

/// What all links of a node share.
struct shared_terms {
    explicit shared_terms(tls_options options)
        : context(options.fleet->own_key()),
          admission(std::make_shared<security::admission_terms>(
              security::admission_terms{.fleet = std::move(options.fleet),
                                        .epoch = std::move(options.epoch),
                                        .handshakes = security::admission_terms::handshake_turns{options.handshakes}})),
          report(std::move(options.report)), time_to_open(options.time_to_open) {}

    tls_context context;
    std::shared_ptr<security::admission_terms> admission;
    std::function<void(const security::refused_link&)> report;
    std::chrono::milliseconds time_to_open;
};

/// The codec of a `tls` link: it is open when the TLS handshake and the admission are complete.
class tls_codec final : public transport::stream_codec {
  public:
    tls_codec(std::shared_ptr<const shared_terms> shared, tls_engine::role as, std::string expected,
              std::string address)
        : shared_(std::move(shared)), engine_(shared_->context, as), address_(std::move(address)),
          admission_(shared_->admission, std::move(expected), host()), awaits_turn_(as == tls_engine::role::server) {}

    std::span<char> prepare() override { return engine_.prepare(); }
    void commit(std::size_t count) override {
        engine_.commit(count);
        received_ = received_ || count != 0; // at the end of the stream, it is 0
    }
    status open(error_code& why) override {
        if (displaced_) {
            why = tls_errc::busy;
            return status::failed;
        }
        if (received_ && std::exchange(awaits_turn_, false) && !admission_.take_handshake(boottime_clock::now())) {
            return fail(why);
        }
        if (lines_) {
            return admit(why);
        }
        const auto shaken = engine_.shake_hands(why);
        if (shaken == status::ended) {
            why = tls_errc::failed;
            return status::failed;
        }
        if (shaken != status::done) {
            return shaken;
        }
        lines_.emplace(admission_.max_line());
        std::string first;
        admission_.begin(engine_.peer_key(), first);
        engine_.write(first, why);
        return why ? status::failed : admit(why);
    }
    [[nodiscard]] std::chrono::milliseconds time_to_open() const override { return shared_->time_to_open; }
    void describe(identity& peer) const override { peer.name = admission_.name(); }
    [[nodiscard]] std::string_view epoch() const noexcept override { return admission_.epoch(); }
    void watch(std::function<void(error_code)> broken) override {
        broken_ = std::move(broken);
        admission_.on_displaced([this](std::string_view line) {
            displaced_ = true;
            write_last(line);
            report();
            broken_(tls_errc::busy);
        });
    }
    status decode(std::span<char> space, std::size_t& count, error_code& why) override {
        if (removed_) {
            why = tls_errc::removed;
            return status::failed;
        }
        if (!rest_.empty()) {
            count = std::min(space.size(), rest_.size());
            std::memcpy(space.data(), rest_.data(), count);
            rest_.erase(0, count);
            return status::done;
        }
        return engine_.read(space, count, why);
    }
    void encode(std::string_view text, error_code& why) override {
        if (removed_) {
            why = tls_errc::removed;
        } else {
            engine_.write(text, why);
        }
    }
    void finish() override {
        admission_.give_up();
        engine_.finish();
    }
    [[nodiscard]] std::string& encoded() noexcept override { return engine_.encrypted(); }
    [[nodiscard]] std::size_t buffered() const noexcept override {
        return engine_.buffered() + (lines_ ? lines_->capacity() : 0);
    }
    void shrink() override { engine_.shrink(); }

  private:
    [[nodiscard]] status admit(error_code& why) {
        for (;;) {
            std::string_view line;
            lines_->set_limit(admission_.max_line());
            switch (lines_->next(line)) {
            case protocol::line_buffer::status::line: // valid for as long as `lines_` is
                if (const auto result = take_line(line, why); result != status::need_input) {
                    return result;
                }
                continue;
            case protocol::line_buffer::status::overlong: why = tls_errc::bad_admission; return status::failed;
            case protocol::line_buffer::status::need_more: break;
            }
            std::string refusal;
            if (admission_.on_part(lines_->unfinished().size(), refusal) == admission::verdict::refused) {
                write_last(refusal);
                return fail(why);
            }
            std::size_t count = 0;
            switch (engine_.read(lines_->prepare(), count, why)) {
            case status::done: lines_->commit(count); break;
            case status::need_input: return status::need_input;
            case status::ended: why = tls_errc::bad_admission; [[fallthrough]];
            case status::failed: return status::failed;
            }
        }
    }
    [[nodiscard]] status take_line(std::string_view line, error_code& why) {
        std::string reply;
        const auto verdict = admission_.on_line(line, reply);
        error_code unsent;
        engine_.write(reply, unsent);
        switch (verdict) {
        case admission::verdict::pending: why = unsent; return unsent ? status::failed : status::need_input;
        case admission::verdict::admitted:
            rest_ = lines_->unfinished();
            lines_.reset();
            engine_.admit();
            observe_roster();
            return status::done;
        case admission::verdict::refused: break;
        }
        return fail(why);
    }
    /// What explains a refusal to the other end. If it cannot be written, the link ends all the same.
    void write_last(std::string_view text) {
        error_code unsent;
        engine_.write(text, unsent);
    }
    status fail(error_code& why) {
        why = code_of(admission_.refused_for());
        report();
        return status::failed;
    }
    void report() const {
        if (shared_->report) {
            const auto from = host();
            const bool is_known = admission_.key() != security::public_key{};
            const auto key = is_known ? security::to_base64url(admission_.key()) : std::string{};
            shared_->report({.kind = admission_.refused_for(), .source = from, .why = admission_.why(), .key = key});
        }
    }
    [[nodiscard]] std::string host() const { return address_.empty() ? std::string{} : parse_url(address_).host; }
    void observe_roster() {
        observation_ = shared_->admission->fleet->observe([this](const security::roster&) {
            if (!removed_ && !admission_.is_in_force()) {
                removed_ = true;
                broken_(tls_errc::removed);
            }
        });
    }

    std::shared_ptr<const shared_terms> shared_;
    tls_engine engine_;
    std::string address_; // of the other end; empty: it is gone already
    admission admission_;
    bool awaits_turn_; // for the handshake
    bool received_ = false;
    bool displaced_ = false;
    std::function<void(error_code)> broken_;
    std::optional<protocol::line_buffer> lines_; // of the admission, once the handshake is done
    std::string rest_;                           // what followed them
    std::shared_ptr<void> observation_;          // of the roster
    bool removed_ = false;
};

class tls_transport final : public link_transport {
  public:
    explicit tls_transport(tls_options options) : shared_(std::make_shared<const shared_terms>(std::move(options))) {}

    [[nodiscard]] bool authenticates() const override { return true; }
    [[nodiscard]] bool is_exposed(const url& where) const override { return transport::is_beyond_loopback(where); }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where,
                                     const limits& bounds) override {
        return transport::listen_tcp(executor, where, bounds, codecs(tls_engine::role::server, {}));
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        return dial_node(executor, where, {}, bounds, std::move(done));
    }

    std::function<void()> dial_node(const asio::any_io_executor& executor, const url& where, std::string_view name,
                                    const limits& bounds, dial_callback done) override {
        return transport::dial_tcp(executor, where, bounds, std::move(done), codecs(tls_engine::role::client, name));
    }

  private:
    [[nodiscard]] transport::codec_maker codecs(tls_engine::role as, std::string_view expected) const {
        return [shared = shared_, as, expected = std::string{expected}](const identity& peer) {
            return std::make_unique<tls_codec>(shared, as, expected, peer.address);
        };
    }

    std::shared_ptr<const shared_terms> shared_;
};

} // namespace

std::unique_ptr<link_transport> make_tls_transport(tls_options options) {
    return std::make_unique<tls_transport>(std::move(options));
}

} // namespace cles::tls
