;; Sends back what it receives. One setting (a byte that is added to each byte),
;; state of format 1: that byte. Panics with last words on a break.
(module
  (@custom "softplug.manifest" "{\"abi\": \"1.0\", \"name\": \"echo\", \"version\": \"1.0.0\", \"licence\": \"MIT\", \"protocol\": \"none\", \"description\": \"Sends back what it receives.\", \"settings\": [{\"name\": \"shift\", \"type\": \"int\", \"default\": 0, \"min\": 0, \"max\": 255, \"text\": \"Added to each byte.\"}], \"state\": {\"saves\": 1, \"accepts\": [1]}}")
  (memory (export "memory") 1 1)
  (global (export "__heap_base") i32 (i32.const 65536))
  (global $shift (mut i32) (i32.const 0))
  ;; input at 0x1000 (4,096 bytes), output at 0x2000 (4,096), words at 0x3000 (256)
  (data (i32.const 16) "\00\10\00\00\00\10\00\00\00\20\00\00\00\10\00\00\00\30\00\00\00\01\00\00")
  (data (i32.const 64) "no breaks, please")

  (func (export "softplug_v1") (result i32) (i32.const 16))

  (func $copy (param $to i32) (param $from i32) (param $length i32)
    (local $end i32) (local $bulk i32)
    (local.set $end (i32.add (local.get $from) (local.get $length)))
    (local.set $bulk (i32.add (local.get $from) (i32.and (local.get $length) (i32.const -8))))
    ;; words of eight bytes where nothing is added
    (block $done
      (br_if $done (i32.ne (global.get $shift) (i32.const 0)))
      (block $whole
        (loop $words
          (br_if $whole (i32.ge_u (local.get $from) (local.get $bulk)))
          (i64.store (local.get $to) (i64.load (local.get $from)))
          (local.set $to (i32.add (local.get $to) (i32.const 8)))
          (local.set $from (i32.add (local.get $from) (i32.const 8)))
          (br $words))))
    (block $end_of_bytes
      (loop $bytes
        (br_if $end_of_bytes (i32.ge_u (local.get $from) (local.get $end)))
        (i32.store8 (local.get $to)
          (i32.add (i32.load8_u (local.get $from)) (global.get $shift)))
        (local.set $to (i32.add (local.get $to) (i32.const 1)))
        (local.set $from (i32.add (local.get $from) (i32.const 1)))
        (br $bytes))))

  (func (export "softplug_v1_step") (param $kind i32) (param $length i32) (param $now i64) (result i32)
    ;; settings: flags u8, then index u16, type u8, zero u8, length u16, value i64
    (if (i32.eq (local.get $kind) (i32.const 1)) (then
      (global.set $shift (i32.load8_u (i32.const 0x1007)))
      (return (i32.const 0))))
    ;; received: transmit with mark 0
    (if (i32.eq (local.get $kind) (i32.const 4)) (then
      (i32.store16 (i32.const 0x2000) (i32.const 1))
      (i32.store16 (i32.const 0x2002) (i32.add (local.get $length) (i32.const 4)))
      (i32.store (i32.const 0x2004) (i32.const 0))
      (call $copy (i32.const 0x2008) (i32.const 0x1000) (local.get $length))
      (return (i32.add (local.get $length) (i32.const 8)))))
    ;; line error: panic
    (if (i32.eq (local.get $kind) (i32.const 5)) (then
      (i32.store (i32.const 0x3000) (i32.const 17))
      (i64.store (i32.const 0x3004) (i64.load (i32.const 64)))
      (i64.store (i32.const 0x300c) (i64.load (i32.const 72)))
      (i32.store8 (i32.const 0x3014) (i32.load8_u (i32.const 80)))
      unreachable))
    ;; save: one piece of one byte
    (if (i32.eq (local.get $kind) (i32.const 22)) (then
      (i32.store16 (i32.const 0x2000) (i32.const 22))
      (i32.store16 (i32.const 0x2002) (i32.const 13))
      (i32.store (i32.const 0x2004) (i32.const 1))
      (i32.store (i32.const 0x2008) (i32.const 0))
      (i32.store (i32.const 0x200c) (i32.const 1))
      (i32.store8 (i32.const 0x2010) (global.get $shift))
      (return (i32.const 17))))
    ;; restore: format u16, zero u16, offset u32, total u32, piece
    (if (i32.eq (local.get $kind) (i32.const 23)) (then
      (if (i32.ne (local.get $length) (i32.const 13)) (then (return (i32.const -4))))
      (global.set $shift (i32.load8_u (i32.const 0x100c)))
      (return (i32.const 0))))
    (i32.const 0)))
