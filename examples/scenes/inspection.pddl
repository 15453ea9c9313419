; A hand with a camera inspects parts where they stand. Only `inspect` is new: its geometry is in inspect_with_camera.py.
(define (domain inspection)
  (:requirements :strips :typing :negative-preconditions :action-costs)
  (:types hand thing table - object
          human_hand robot_hand - hand)
  (:predicates
    (free ?e - hand)
    (on_table ?o - thing)
    (inspected ?o - thing))
  (:functions (total-cost) - number)

  (:action inspect
    :parameters (?e - hand ?o - thing)
    :precondition (and (free ?e) (on_table ?o) (not (inspected ?o)))
    :effect (and (inspected ?o) (increase (total-cost) 0.5))))
