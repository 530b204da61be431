;; Counts the bytes that it receives, saves the count, and traps at a letter.
(module
  (@custom "softplug.manifest"
    "{\"abi\":\"1.0\",\"name\":\"fragile\",\"version\":\"VERSION\",\"licence\":\"MIT\","
    "\"protocol\":\"none\",\"description\":\"Traps.\",\"state\":{\"saves\":1,\"accepts\":[1]}}")
  (memory (export "memory") 1 1)
  ;; The mailbox: 512 bytes in, 1,024 out, 64 for last words.
  (data (i32.const 16) "\00\04\00\00\00\02\00\00" "\00\08\00\00\00\04\00\00" "\40\00\00\00\40\00\00\00")
  (data (i32.const 68) "letter!")
  (global $count (mut i32) (i32.const 0))
  (func (export "softplug_v1") (result i32) (i32.const 16))
  (func (export "softplug_v1_step") (param $kind i32) (param $len i32) (param $now i64) (result i32)
    (local $at i32)
    ;; received
    (if (i32.eq (local.get $kind) (i32.const 4)) (then
      (global.set $count (i32.add (global.get $count) (local.get $len)))
      (block $end (loop $next
        (br_if $end (i32.ge_u (local.get $at) (local.get $len)))
        (if (i32.eq (i32.load8_u offset=1024 (local.get $at)) (i32.const LETTER)) (then
          (i32.store (i32.const 64) (i32.const 7))
          unreachable))
        (local.set $at (i32.add (local.get $at) (i32.const 1)))
        (br $next)))))
    ;; restore: the count behind format, offset and total
    (if (i32.eq (local.get $kind) (i32.const 23))
      (then (global.set $count (i32.load (i32.const 1036)))))
    ;; save
    (if (i32.eq (local.get $kind) (i32.const 22)) (then
      (i32.store (i32.const 2048) (i32.const 0x00100016))
      (i32.store (i32.const 2052) (i32.const 1))
      (i32.store (i32.const 2056) (i32.const 0))
      (i32.store (i32.const 2060) (i32.const 4))
      (i32.store (i32.const 2064) (global.get $count))
      (return (i32.const 20))))
    (i32.const 0)))
