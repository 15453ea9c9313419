; Every action of `ACTIONS`, for any hand.
(define (domain every_hand)
  (:requirements :strips :typing :negative-preconditions)
  (:types hand thing table - object
          human_hand robot_hand - hand)
  (:predicates
    (free ?e - hand)
    (on_table ?o - thing)
    (grasped ?e - hand ?o - thing)
    (placed ?o - thing ?p - table)
    (held ?o - thing)
    (screwed ?o1 - thing ?o2 - thing)
    (holding ?e - hand ?o - thing)
    (fit ?o1 - thing ?o2 - thing))
  (:action grasp
    :parameters (?e - hand ?o - thing)
    :precondition (and (free ?e) (on_table ?o))
    :effect (and (grasped ?e ?o) (not (free ?e)) (not (on_table ?o))))
  (:action place
    :parameters (?e - hand ?o - thing ?p - table)
    :precondition (grasped ?e ?o)
    :effect (and (placed ?o ?p) (not (grasped ?e ?o)) (free ?e) (on_table ?o)))
  (:action handover
    :parameters (?e1 - hand ?o - thing ?e2 - hand)
    :precondition (and (grasped ?e1 ?o) (free ?e2))
    :effect (and (not (grasped ?e1 ?o)) (free ?e1) (grasped ?e2 ?o) (not (free ?e2))))
  (:action hold
    :parameters (?e - hand ?o - thing)
    :precondition (and (on_table ?o) (free ?e))
    :effect (and (held ?o) (not (free ?e)) (holding ?e ?o)))
  (:action screw
    :parameters (?e - hand ?o1 - thing ?o2 - thing)
    :precondition (and (on_table ?o1) (on_table ?o2) (free ?e) (held ?o1) (fit ?o1 ?o2))
    :effect (and (screwed ?o1 ?o2) (not (held ?o1))))
  (:action release
    :parameters (?e - hand ?o - thing)
    :precondition (and (holding ?e ?o) (not (held ?o)))
    :effect (and (free ?e) (not (holding ?e ?o)))))
