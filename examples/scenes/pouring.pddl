; A jug is brought upright to a cup and tilted above it. `bring` and `pour` are new: their geometry is in pour.py.
(define (domain pouring)
  (:requirements :strips :typing :negative-preconditions :equality :conditional-effects)
  (:types hand thing table - object
          human_hand robot_hand - hand)
  (:predicates
    (free ?e - hand)
    (on_table ?o - thing)
    (grasped ?e - hand ?o - thing)
    (placed ?o - thing ?p - table)
    (full ?o - thing)
    (over ?o - thing ?c - thing)   ; its spout is above the cup
    (poured ?c - thing))

  (:action grasp
    :parameters (?e - hand ?o - thing)
    :precondition (and (free ?e) (on_table ?o) (full ?o))
    :effect (and (grasped ?e ?o) (not (free ?e)) (not (on_table ?o))))

  (:action bring
    :parameters (?e - hand ?o - thing ?c - thing)
    :precondition (and (grasped ?e ?o) (on_table ?c) (full ?o) (not (full ?c)) (not (= ?o ?c)))
    :effect (over ?o ?c))

  (:action pour
    :parameters (?e - hand ?o - thing ?c - thing)
    :precondition (and (grasped ?e ?o) (over ?o ?c))
    :effect (and (poured ?c) (not (over ?o ?c)) (when (full ?o) (and (full ?c) (not (full ?o))))))

  (:action place
    :parameters (?e - hand ?o - thing ?p - table)
    :precondition (and (grasped ?e ?o) (not (full ?o)))
    :effect (and (placed ?o ?p) (not (grasped ?e ?o)) (free ?e) (on_table ?o))))
