;; Invents what a machine sends: as much as there is room for, at every chance that it gets.
;; One delivery without an end, or, with MANY, deliveries of one byte each.
(module
  (@custom "softplug.manifest"
    "{\"abi\":\"1.0\",\"name\":\"NAME\",\"version\":\"1.0.0\",\"licence\":\"MIT\","
    "\"protocol\":\"none\",\"description\":\"Floods.\",\"state\":{\"saves\":1,\"accepts\":[1]}}")
  (memory (export "memory") 1 1)
  ;; The mailbox: 512 bytes in, 4,096 out, 64 for last words.
  (data (i32.const 16) "\00\04\00\00\00\02\00\00" "\00\10\00\00\00\10\00\00" "\40\00\00\00\40\00\00\00")
  (global $room (mut i32) (i32.const 0))
  (global $id (mut i32) (i32.const 0))
  (global $at (mut i32) (i32.const 0))
  (func (export "softplug_v1") (result i32) (i32.const 16))
  ;; A record's header, and the delivery's number.
  (func $record (param $kind i32) (param $length i32)
    (i32.store16 (global.get $at) (local.get $kind))
    (i32.store16 offset=2 (global.get $at) (local.get $length))
    (i32.store offset=4 (global.get $at) (global.get $id))
    (i32.store offset=8 (global.get $at) (i32.const 0))
    (global.set $at (i32.add (global.get $at) (i32.add (local.get $length) (i32.const 4)))))
  (func $one (result i32)
    (local $count i32)
    (global.set $at (i32.const 0x1000))
    (if (i32.eqz (global.get $id)) (then
      (global.set $id (i32.const 1))
      (call $record (i32.const 11) (i32.const 8))))
    (local.set $count (select (i32.const 3000) (global.get $room)
      (i32.gt_u (global.get $room) (i32.const 3000))))
    (if (local.get $count) (then
      (call $record (i32.const 12) (i32.add (local.get $count) (i32.const 4)))))
    (global.set $room (i32.sub (global.get $room) (local.get $count)))
    (i32.sub (global.get $at) (i32.const 0x1000)))
  (func $many (result i32)
    (local $left i32)
    (global.set $at (i32.const 0x1000))
    (local.set $left (i32.const 20))
    (block $end (loop $next
      (br_if $end (i32.eqz (global.get $room)))
      (br_if $end (i32.eqz (local.get $left)))
      (global.set $id (i32.add (global.get $id) (i32.const 1)))
      (call $record (i32.const 11) (i32.const 8))
      (call $record (i32.const 12) (i32.const 5))
      (call $record (i32.const 14) (i32.const 8))
      (global.set $room (i32.sub (global.get $room) (i32.const 1)))
      (local.set $left (i32.sub (local.get $left) (i32.const 1)))
      (br $next)))
    (i32.sub (global.get $at) (i32.const 0x1000)))
  (func (export "softplug_v1_step") (param $kind i32) (param $len i32) (param $now i64) (result i32)
    ;; open: the room is behind rate and room to transmit
    (if (i32.eq (local.get $kind) (i32.const 2)) (then
      (global.set $room (i32.load offset=1036 (i32.const 0)))
      (global.set $id (i32.const 0))
      (return (call $HOW))))
    ;; more room
    (if (i32.eq (local.get $kind) (i32.const 13)) (then
      (global.set $room (i32.add (global.get $room) (i32.load offset=1024 (i32.const 0))))
      (return (call $HOW))))
    ;; save
    (if (i32.eq (local.get $kind) (i32.const 22)) (then
      (i32.store (i32.const 0x1000) (i32.const 0x00100016))
      (i32.store (i32.const 0x1004) (i32.const 1))
      (i32.store (i32.const 0x1008) (i32.const 0))
      (i32.store (i32.const 0x100c) (i32.const 4))
      (i32.store (i32.const 0x1010) (i32.const 0))
      (return (i32.const 20))))
    (i32.const 0)))
